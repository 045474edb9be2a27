"""Parameters of the local planner that stand in the scenario, and in the node under the same names.

Those given to the node win; the others are the scenario's, so that it drives as in process.
"""

from collections.abc import Mapping
from typing import Any

from serd_ros.parameters.configs import LocalPlannerConfig
from sim.planning.settings import PlannerSettings
from sim.scenario.scenario import Scenario, load_scenario

_NAMES = tuple(PlannerSettings.model_fields)


def of_scenario(values: Mapping[str, Any]) -> dict[str, Any]:
    """The planner's parameters as the scenario among the node's values has them."""
    name = values["scenario"]
    if not isinstance(name, str) or not name:
        return {}  # which is what the node's own check refuses
    scenario = load_scenario(name)
    parameters = scenario.local_planner.complete(scenario.robot, scenario.control_period_s)
    return parameters.model_dump()


def planned_scenario(config: LocalPlannerConfig) -> Scenario:
    """The node's scenario with the planner's parameters that the node was given."""
    parameters = PlannerSettings(**{name: getattr(config, name) for name in _NAMES})
    return load_scenario(config.scenario).with_local_planner(parameters)
