"""Values for a node's config: defaults, ranges and types, each fault a sentence."""

import pytest

from serd_files.yaml_config import model_yaml
from serd_ros.errors import NodeError
from serd_ros.graph.graph import config_of, load_graph
from serd_ros.nodes.guard import GuardConfig
from serd_ros.nodes.hallway_sim import HallwaySimConfig
from serd_ros.nodes.learner import LearnerConfig
from serd_ros.nodes.local_planner import LocalPlannerConfig
from serd_ros.process.parameters import validated
from serd_sim.errors import SimError
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario


@pytest.mark.parametrize("node", sorted(load_graph().nodes))
def test_the_defaults_of_every_node_are_valid(node):
    config = config_of(node)
    assert validated(node, {}, config) == config(**config.defaults({}))


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"seed": -1}, "seed must be greater than or equal to 0, got -1"),
        (
            {"command_timeout_s": 0.8},
            "command_timeout_s must be less than or equal to 0.5, got 0.8",
        ),
        ({"lockstep": "yes"}, "lockstep must be a boolean, got 'yes'"),
        ({"lockstep_timeout_s": float("nan")}, "lockstep_timeout_s must be a finite number"),
    ],
)
def test_a_bad_value_names_the_parameter_the_rule_and_the_value(values, sentence):
    with pytest.raises(NodeError, match=f"parameter of hallway_sim: {sentence}"):
        validated("hallway_sim", values, HallwaySimConfig)


def test_a_whole_number_is_taken_for_a_float():
    assert validated("learner", {"pseudo_count": 1}, LearnerConfig).pseudo_count == 1.0


def config(scenario, **given):
    """The config of the node: its defaults, then the scenario's, then the values given."""
    return validated("local_planner", {"scenario": str(scenario), **given}, LocalPlannerConfig)


@pytest.fixture
def slow_corridor(tmp_path):
    """A corridor whose robot is slower than usual and whose planner is slower still."""
    corridor = load_scenario("corridor")
    robot = corridor.robot.model_copy(update={"max_vel_x_mps": 0.9, "acc_lim_x_mps2": 2.0})
    planner = PlannerSettings(max_vel_x=0.7, sim_time=2.0)
    path = tmp_path / "slow.yaml"
    changes = {"robot": robot, "local_planner": planner, "control_period_s": 0.1}
    path.write_text(model_yaml(corridor.model_copy(update=changes)))
    return path


@pytest.mark.parametrize("name", builtin_scenarios())
def test_the_defaults_of_the_node_are_those_of_every_built_in_scenario(name):
    parameters = LocalPlannerConfig.defaults({"scenario": name})
    assert None not in parameters.values()
    assert parameters == LocalPlannerConfig.defaults({})


def test_what_is_not_given_is_the_scenarios(slow_corridor):
    found = config(slow_corridor)
    assert (found.max_vel_x, found.sim_time) == (0.7, 2.0)
    assert (found.acc_lim_x, found.min_vel_x, found.vx_samples) == (2.0, -0.3, 9)
    assert found.controller_frequency == 10.0


def test_what_is_given_wins_and_reaches_the_planner(slow_corridor):
    scenario = config(slow_corridor, max_vel_x=0.5, vx_samples=5).planned_scenario()
    limited = scenario.local_planner.limited(scenario.robot)
    assert (limited.max_vel_x_mps, limited.acc_lim_x_mps2) == (0.5, 2.0)
    assert (scenario.local_planner.vx_samples, scenario.local_planner.sim_time) == (5, 2)
    assert scenario.robot == load_scenario(slow_corridor).robot


def test_a_node_without_parameters_plans_for_the_very_robot_of_the_scenario():
    scenario, given = config("hallway").planned_scenario(), load_scenario("hallway")
    braking = {"decel_lim_x_mps2": given.robot.acc_lim_x_mps2}  # as planners accelerate
    limited = scenario.local_planner.limited(scenario.robot)
    assert limited == given.robot.model_copy(update=braking)
    complete = given.local_planner.complete(given.robot, given.control_period_s)
    assert scenario.local_planner == complete


@pytest.mark.parametrize(
    ("given", "error", "sentence"),
    [
        ({"max_vel_x": 1.0}, SimError, r"max_vel_x must be at most robot\.max_vel_x_mps \(0\.9\)"),
        ({"controller_frequency": 20.0}, SimError, r"control_period_s \(10 Hz\), got 20"),
        ({"sim_time": -1.0}, NodeError, "parameter of local_planner: sim_time must be greater"),
    ],
)
def test_a_value_that_cannot_be_is_refused(slow_corridor, given, error, sentence):
    with pytest.raises(error, match=sentence):
        config(slow_corridor, **given).planned_scenario()


def test_a_guard_of_a_robot_that_accelerates_less_does_not_count_on_harder_braking():
    def braking(**given):
        return validated("guard", {"scenario": "hallway", **given}, GuardConfig).guard().braking

    assert braking() == load_scenario("hallway").robot.decel_lim_x_mps2
    assert braking(acc_lim_x=1.0) == 1.0
    assert braking(acc_lim_x=1.0, decel_lim_x=3.0) == 3.0
