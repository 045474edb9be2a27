"""Local planners by name."""

from collections.abc import Callable

from sim.errors import SimError
from sim.local_planner import LocalPlanner
from sim.planning.dwa import DwaPlanner
from sim.planning.mppi import MppiPlanner
from sim.planning.recovery import RecoveringPlanner
from sim.scenario import Scenario
from storage.nearest import nearest_name

_PLANNERS: dict[str, Callable[[Scenario], LocalPlanner]] = {"dwa": DwaPlanner, "mppi": MppiPlanner}


def planner_names() -> tuple[str, ...]:
    """Names `make_planner` knows."""
    return tuple(_PLANNERS)


def make_planner(name: str, scenario: Scenario) -> RecoveringPlanner:
    """A planner for the scenario's walls and robot, with its default settings and recoveries."""
    if name not in _PLANNERS:
        meant = nearest_name(name, planner_names()) or planner_names()[0]
        raise SimError(
            f"planner must be one of {', '.join(_PLANNERS)}, got {name!r}; did you mean {meant!r}?"
        )
    return RecoveringPlanner(_PLANNERS[name](scenario), scenario)
