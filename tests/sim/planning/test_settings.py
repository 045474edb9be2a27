"""Parameters of the local planners by Nav2's names: where they come from and what they do."""

import numpy as np
import pytest
import yaml

from serd_files.errors import USER_ERRORS
from serd_files.yaml_config import model_yaml
from serd_sim.crowd import social_force
from serd_sim.crowd.social_force import CircularAnisotropic
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner, planner_in_world, planner_names
from serd_sim.planning.recovery import RecoveringPlanner
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at
from tests.sim.planning.test_recovery import ON, PushingPlanner

KINEMATIC = load_scenario("hallway").with_values("robot", drive="kinematic")
HALLWAY = KINEMATIC.with_pedestrian_count(0)
AHEAD = Waypoint(3.0, 12.0)


def with_parameters(**parameters):
    return HALLWAY.with_local_planner(PlannerSettings(**parameters))


def written(tmp_path, scenario=HALLWAY, **parameters):
    content = yaml.safe_load(model_yaml(scenario))
    content["local_planner"] = parameters
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def driven(scenario, name, duration_s=4.0):
    """(n, 2) speeds and turning rates of the robot on its way up the empty hallway."""
    motion = []

    def see(observation, *_):
        motion.append((observation.speed_mps, observation.yaw_rate_radps))

    with HallwayWorld(scenario, seed=3) as world:
        planner = planner_in_world(name, world)
        driver = make_driver("expert", scenario, 3)
        run_episode(world, planner, driver, episode=0, timeout_s=duration_s, observer=see)
    return np.array(motion)


def standing_at(time_s, *, people=()):
    return observation_at(3.0, 8.0, time_s=time_s, people=people)


def recoveries(scenario, duration_s=40.0, people=()):
    """Commands of the recoveries a stuck robot begins, and how long each lasts (s)."""
    planner = RecoveringPlanner(PushingPlanner(), scenario)
    found = {}
    for tick in range(round(duration_s / 0.05)):
        command = planner.step(standing_at(0.05 * tick, people=people), AHEAD)
        if command != ON:
            found[command] = found.get(command, 0.0) + 0.05
    return found


@pytest.mark.parametrize("name", planner_names())
def test_a_scenarios_planner_keeps_to_its_speeds(tmp_path, name):
    slow = load_scenario(written(tmp_path, max_vel_x=0.5, max_vel_theta=0.8))
    motion, unlimited = driven(slow, name), driven(HALLWAY, name)
    assert 0.4 < motion[:, 0].max() <= 0.5 + 1e-9
    assert np.abs(motion[:, 1]).max() <= 0.8 + 1e-9
    assert unlimited[:, 0].max() > 0.8


@pytest.mark.parametrize("name", planner_names())
def test_a_scenarios_planner_keeps_to_its_accelerations(name):
    gentle = driven(with_parameters(acc_lim_x=0.8, acc_lim_theta=2.0, max_vel_x=0.8), name)
    change = np.abs(np.diff(gentle, axis=0)) / 0.05
    assert change[:, 0].max() == pytest.approx(0.8)
    assert change[:, 1].max() == pytest.approx(2.0)


@pytest.mark.parametrize("scenario", [load_scenario(name) for name in builtin_scenarios()])
def test_giving_all_the_defaults_changes_nothing(scenario):
    complete = scenario.local_planner.complete(scenario.robot, scenario.control_period_s)
    braking = {"decel_lim_x_mps2": scenario.robot.acc_lim_x_mps2}  # as planners accelerate
    assert complete.limited(scenario.robot) == scenario.robot.model_copy(update=braking)
    assert None not in complete.model_dump().values()
    explicit = scenario.with_local_planner(complete)
    for name in planner_names():
        planner, other = make_planner(name, scenario), make_planner(name, explicit)
        assert planner.step(standing_at(0.0), AHEAD) == other.step(standing_at(0.0), AHEAD)


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
    found = []
    for name in planner_names():
        planner = make_planner(name, scenario)
        people = [(3.2, 9.2), (2.4, 9.8)]
        for y_m, yaw_rad in ((8.0, 1.2), (8.0, -0.5), (10.5, 0.3), (11.88, 1.2)):
            observation = observation_at(3.0, y_m, yaw_rad, speed_mps=0.3, people=people)
            found += [planner.step(observation, AHEAD) for _ in range(2)]
    stuck = RecoveringPlanner(PushingPlanner(is_blocked=True), scenario)
    for tick in range(1000):
        x_m = 3.6 if tick < 300 and tick // 50 % 2 else 3.0  # 0.6 m to and fro, then at rest
        command = stuck.step(observation_at(x_m, 8.0, time_s=0.1 * tick), AHEAD)
        found.append((command, stuck.status, stuck.n_recoveries))
    return found


def test_recovery_and_costs_know_how_wide_the_people_of_the_scenario_are(monkeypatch):
    """A person of 0.6 m whose middle is 0.9 m behind leaves no room to back off, one of 0.25 m
    does."""
    monkeypatch.setitem(social_force._MODELS, "wide", CircularAnisotropic(body_radius_m=0.6))
    behind = [(2.1, 8.0)]
    pedestrians = HALLWAY.pedestrians.model_copy(update={"model": "wide"})
    wide = HALLWAY.model_copy(update={"pedestrians": pedestrians})
    assert min(c.linear_mps for c in recoveries(HALLWAY, 14.0, behind)) < 0.0
    assert min((c.linear_mps for c in recoveries(wide, 14.0, behind)), default=0.0) == 0.0
    in_the_way = standing_at(0.0, people=[(3.75, 8.0)])
    for name in planner_names():
        near = make_planner(name, HALLWAY).step(in_the_way, Waypoint(6.0, 8.0))
        nearer = make_planner(name, wide).step(in_the_way, Waypoint(6.0, 8.0))
        assert near != nearer


def test_the_path_integral_planner_keeps_its_plan_by_the_control_period_of_the_scenario():
    """Twice the period, twice as far along the plan."""
    plans = {}
    for period_s in (0.05, 0.1):
        scenario = HALLWAY.model_copy(update={"control_period_s": period_s})
        planner = make_planner("mppi", scenario)
        planner.step(standing_at(0.0), AHEAD)
        plans[period_s] = planner.planner.plan
    half, whole = plans[0.05], plans[0.1]
    assert np.allclose(whole[:, -1], 0.0)
    assert not np.allclose(half[:, -1], 0.0)
    assert not np.allclose(half, whole)


def test_a_robot_at_rest_within_a_wide_tolerance_is_not_stuck():
    planner = make_planner("dwa", with_parameters(xy_goal_tolerance=0.6))
    for tick in range(600):
        assert planner.step(standing_at(0.05 * tick), Waypoint(3.0, 8.5)) == STOP
    assert planner.n_recoveries == 0


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"max_vel": 1.0}, r"local_planner\.max_vel is not a known key; did you mean 'max_vel_x'"),
        ({"max_vel_x": 2.0}, r"local_planner\.max_vel_x must be at most robot\.max_vel_x_mps \(1"),
        ({"min_vel_x": -0.5}, r"min_vel_x must be at least robot\.min_vel_x_mps \(-0\.3\), got -0"),
        ({"vx_samples": 1}, r"vx_samples must be greater than or equal to 3, got 1"),
        ({"sim_time": "2"}, r"local_planner\.sim_time must be a number, got '2'"),
        (
            {"controller_frequency": 10.0},
            r"must be 1 / control_period_s \(20 Hz\), got 10; leave it out or set control_period_s "
            r"to 0\.1",
        ),
    ],
)
def test_a_parameter_that_cannot_be_is_refused_by_name(tmp_path, parameters, sentence):
    with pytest.raises(USER_ERRORS, match=sentence):
        load_scenario(written(tmp_path, **parameters))


@pytest.mark.parametrize(
    ("name", "parameters", "sentence"),
    [
        ("dwa", {"sim_time": 0.5}, r"sim_time must be at least 0\.78 s, in which .* got 0\.5 s"),
        ("mppi", {"time_steps": 5}, r"time_steps times model_dt must be at least 0\.78 s"),
        ("dwa", {"acc_lim_x": 0.5}, r"at least 2\.7 s, .* \(1\.2 m/s at 0\.5 m/s2\), got 1\.4 s; "),
    ],
)
def test_a_planner_that_sees_less_far_than_the_robot_takes_to_stop_is_refused(
    name, parameters, sentence
):
    with pytest.raises(USER_ERRORS, match=sentence):
        make_planner(name, with_parameters(**parameters))
