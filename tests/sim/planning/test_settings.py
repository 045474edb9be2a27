"""Parameters of the local planners by Nav2's names: where they come from and what they do."""

import numpy as np
import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.crowd import social_force
from serd_sim.crowd.social_force import CircularAnisotropic
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import RecoveringPlanner, make_planner
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at
from tests.sim.planning.test_recovery import PushingPlanner

KINEMATIC = load_scenario("hallway").with_values("robot", drive="kinematic")
HALLWAY = KINEMATIC.with_pedestrian_count(0)
AHEAD = Waypoint(3.0, 12.0)


def with_parameters(**parameters):
    return HALLWAY.with_local_planner(PlannerSettings(**parameters))


def driven(scenario):
    """(n, 2) speeds and turning rates of the robot within 4 s of its way up the empty hallway."""
    motion = []
    with HallwayWorld(scenario, seed=3) as world:
        planner, driver = make_planner(scenario), make_driver("expert", scenario, 3)
        run_episode(
            world, planner, driver, episode=0, timeout_s=4.0,
            observer=lambda seen, *_: motion.append((seen.speed_mps, seen.yaw_rate_radps)),
        )  # fmt: skip
    return np.array(motion)


def test_a_scenarios_planner_keeps_to_its_speeds_and_accelerations():
    limits = {"max_vel_x": 0.5, "max_vel_theta": 0.8, "acc_lim_x": 0.8, "acc_lim_theta": 2.0}
    motion = driven(with_parameters(**limits))
    assert 0.4 < motion[:, 0].max() <= 0.5 + 1e-9
    assert np.abs(motion[:, 1]).max() <= 0.8 + 1e-9
    change = np.abs(np.diff(motion, axis=0)) / 0.05
    assert change[:, 0].max() == pytest.approx(0.8)
    assert change[:, 1].max() == pytest.approx(2.0)
    assert driven(HALLWAY)[:, 0].max() > 0.8


@pytest.mark.parametrize("scenario", ["hallway", "social_v1/queue"])
def test_giving_all_the_defaults_changes_nothing(scenario):
    scenario = load_scenario(scenario)
    complete = scenario.local_planner.complete(scenario.robot, scenario.control_period_s)
    braking = {"decel_lim_x_mps2": scenario.robot.acc_lim_x_mps2}  # as planners accelerate
    assert complete.limited(scenario.robot) == scenario.robot.model_copy(update=braking)
    assert None not in complete.model_dump().values()
    seen = observation_at(3.0, 8.0)
    places = scenario, scenario.with_local_planner(complete)
    assert len({make_planner(place).step(seen, AHEAD) for place in places}) == 1


def test_every_parameter_has_an_effect_on_a_planner_or_the_recoveries():
    changed = {
        name: field.default + 1 if isinstance(field.default, int) else 1.5 * field.default
        for name, field in PlannerSettings.model_fields.items()
        if field.default is not None
    }
    limited = {"max_vel_x", "min_vel_x", "max_vel_theta", "acc_lim_x", "acc_lim_theta"}
    assert set(changed) | limited | {"controller_frequency"} == set(PlannerSettings.model_fields)
    before = behaviour(PlannerSettings())
    for name, value in changed.items():
        assert behaviour(PlannerSettings(**{name: value})) != before, name


def behaviour(parameters):
    """Commands on the way and near the waypoint; commands and status of a stuck, blocked robot."""
    scenario = HALLWAY.with_local_planner(parameters)
    planner, people, found = make_planner(scenario), [(3.2, 9.2), (2.4, 9.8)], []
    for y_m, yaw_rad in ((8.0, 1.2), (8.0, -0.5), (10.5, 0.3), (11.88, 1.2)):
        observation = observation_at(3.0, y_m, yaw_rad, speed_mps=0.3, people=people)
        found.append(planner.step(observation, AHEAD))
    stuck = RecoveringPlanner(PushingPlanner(is_blocked=True), scenario)
    for tick in range(500):
        x_m = 3.6 if tick < 150 and tick // 25 % 2 else 3.0  # 0.6 m to and fro, then at rest
        command = stuck.step(observation_at(x_m, 8.0, time_s=0.2 * tick), AHEAD)
        found.append((command, stuck.status, stuck.n_recoveries))
    return found


def test_recovery_and_costs_know_how_wide_the_people_of_the_scenario_are(monkeypatch):
    """A person of 0.6 m whose middle is 0.9 m behind leaves no room to back off."""
    monkeypatch.setitem(social_force._MODELS, "wide", CircularAnisotropic(body_radius_m=0.6))
    wide = HALLWAY.with_values("pedestrians", model="wide")
    backs_off = []
    for scenario in (HALLWAY, wide):
        stuck = RecoveringPlanner(PushingPlanner(), scenario)
        steps = (observation_at(3.0, 8.0, time_s=t, people=[(2.1, 8.0)]) for t in range(14))
        backs_off.append(min(stuck.step(seen, AHEAD).linear_mps for seen in steps) < 0.0)
    assert backs_off == [True, False]
    in_the_way = observation_at(3.0, 8.0, people=[(3.75, 8.0)])
    commands = [make_planner(each).step(in_the_way, AHEAD) for each in (HALLWAY, wide)]
    assert commands[0] != commands[1]


def test_a_robot_at_rest_within_a_wide_tolerance_is_not_stuck():
    planner = make_planner(with_parameters(xy_goal_tolerance=0.6))
    for time_s in range(30):
        seen = observation_at(3.0, 8.0, time_s=time_s)
        assert planner.step(seen, Waypoint(3.0, 8.5)) == STOP
    assert planner.n_recoveries == 0


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"max_vel": 1.0}, r"local_planner\.max_vel is not a known key; .* 'max_vel_x'"),
        ({"max_vel_x": 2.0}, r"local_planner\.max_vel_x must be at most .*max_vel_x_mps \(1"),
        ({"min_vel_x": -0.5}, r"must be at least robot\.min_vel_x_mps \(-0\.3\), got -0"),
        ({"vx_samples": 1}, r"vx_samples must be greater than or equal to 3, got 1"),
        ({"controller_frequency": 10.0}, r"\(20 Hz\), got 10; .* control_period_s to 0\.1"),
        ({"sim_time": 0.5}, r"sim_time must be at least 0\.78 s, in which .* got 0\.5 s"),
        ({"acc_lim_x": 0.5}, r"at least 2\.7 s, .* \(1\.2 m/s at 0\.5 m/s2\), got 1\.4 s; "),
    ],
)
def test_a_parameter_that_cannot_be_is_refused_by_name(parameters, sentence):
    with pytest.raises(USER_ERRORS, match=sentence):
        make_planner(HALLWAY.with_values("local_planner", **parameters))
