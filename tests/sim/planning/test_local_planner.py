"""What every local planner must do: arrive, wait, keep off walls and people, repeat itself."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.batch import EpisodeTask, run_task
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import (
    Behaviour,
    PlannerStatus,
    RecoveringPlanner,
    behaviours_of,
    make_planner,
)
from serd_sim.planning.settings import PlannerSettings
from serd_sim.planning.sight import Sight
from serd_sim.safety.motion import compose
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.polygon import distance_to_segments_m
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import Obstacle
from serd_sim.world.command import STOP, Command, chord_velocity, limited_velocity
from serd_sim.world.waypoint import Waypoint, waypoint_of_intent
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


@pytest.fixture
def planner():
    return make_planner(HALLWAY)


def drive(planner, pose, waypoint, n_ticks, people=()):
    """Ideal robot without a world: poses (n, 3) and speeds (n,) under the planner's commands."""
    speed = turn = 0.0
    poses, speeds = [], []
    for _ in range(n_ticks):
        observation = observation_at(*pose, speed_mps=speed, yaw_rate_radps=turn, people=people)
        command = planner.step(observation, waypoint)
        speed, turn = limited_velocity(command, speed, turn, HALLWAY.robot, 0.05)
        vx, vy = chord_velocity(pose[2], speed, turn, 0.05)
        pose = (pose[0] + 0.05 * vx, pose[1] + 0.05 * vy, pose[2] + 0.05 * turn)
        poses.append(pose)
        speeds.append(speed)
    return np.array(poses), np.array(speeds)


@pytest.mark.parametrize(
    ("start", "yaw_rad"),
    [((2.1, 8.1), -math.pi), ((2.9, 8.1), -math.pi / 2), ((0.4, 8.6), 0.0), ((2.1, 8.1), 1.6)],
)
def test_an_unhindered_robot_passes_the_next_cell_within_its_patience(planner, start, yaw_rad):
    """Near a border it may swing into the cell beside it first, where it faces that way."""
    observation = observation_at(*start, yaw_rad)
    waypoint = waypoint_of_intent(HALLWAY.cells, observation, Action.NORTH)
    poses, _ = drive(planner, observation.pose, waypoint, round(HALLWAY.patience_s / 0.05))
    wanted = GRID.neighbours[GRID.state_at(*start), Action.NORTH]
    assert wanted in GRID.states_at(poses[:, :2])


def test_a_robot_passes_the_corner_of_a_table_in_cells_that_it_nearly_fills():
    """Cells of 0.24 m, a robot of 0.21 m; the next cell is 3 mm from the table."""
    table = Obstacle(name="table", outline_m=((2.0, 0.7), (2.6, 0.7), (2.6, 1.7), (2.0, 1.7)))
    robot = HALLWAY.robot.model_copy(update={"radius_m": 0.105, "max_vel_x_mps": 0.4})
    changes = {"cell_size_m": 0.24, "robot": robot, "obstacles": (table,)}
    planner = make_planner(HALLWAY.model_copy(update=changes))
    poses, _ = drive(planner, (1.843, 0.605, -0.4), Waypoint(2.28, 0.6), 60)
    assert math.dist(poses[-1, :2], (2.28, 0.6)) < 0.12
    assert np.hypot(*(poses[:, :2] - (2.0, 0.7)).T).min() > robot.radius_m


def test_the_robot_stops_at_the_waypoint_and_drives_the_same_after_a_reset(planner):
    observation = observation_at(2.0, 5.0, 1.0, speed_mps=0.5)
    assert planner.step(observation, None) == planner.step(observation, Waypoint(2.0, 5.0)) == STOP
    drives = []
    for _ in range(2):
        planner.reset()
        drives.append(drive(planner, (2.0, 5.0, 0.0), Waypoint(3.5, 5.0), 100))
    (poses, speeds), (again, _) = drives
    np.testing.assert_array_equal(again, poses)
    assert np.abs(speeds[-10:]).max() < 1e-9
    assert np.hypot(*(poses[-1, :2] - [3.5, 5.0])) < 0.12


@pytest.mark.parametrize("yaw_rad", [0.3, math.pi / 2])
def test_a_waypoint_behind_a_wall_never_makes_the_robot_touch_it(planner, yaw_rad):
    poses, _ = drive(planner, (5.0, 8.0, yaw_rad), Waypoint(7.5, 8.0), 100)
    assert poses[:, 0].max() < 6.0 - HALLWAY.robot.radius_m


def test_a_waypoint_that_a_wall_hides_is_driven_to_round_it_and_one_without_a_way_is_kept():
    """The wall is longer than a rollout; the shorter way round it is on the right."""
    wall = Obstacle(name="wall", outline_m=((1.0, 8.0), (4.0, 8.0), (4.0, 8.2), (1.0, 8.2)))
    planner = make_planner(HALLWAY.model_copy(update={"obstacles": (wall,)}))
    poses, _ = drive(planner, (3.0, 7.0, 0.0), Waypoint(3.0, 9.0), 200)
    assert math.dist(poses[-1, :2], (3.0, 9.0)) < 0.12
    beside = poses[np.abs(poses[:, 1] - 8.1) < 0.1]
    assert (beside[:, 0] > 4.0 + HALLWAY.robot.radius_m).all()
    closed = Obstacle(name="wall", outline_m=((-1.0, 8.0), (7.0, 8.0), (7.0, 8.2), (-1.0, 8.2)))
    sight = Sight(HALLWAY.model_copy(update={"obstacles": (closed,)}))
    for waypoint in (Waypoint(3.0, 9.0), Waypoint(3.0, -5.0), Waypoint(500.0, 9.0)):
        assert sight.aim(observation_at(3.0, 7.0), waypoint) == waypoint


def test_the_way_to_wherever_a_robot_aims_is_clear_of_walls():
    """Between places 0.4 m from walls, on both sides of one with a gap of 0.7 m."""
    walls = tuple(
        Obstacle(name="wall", outline_m=((a, 8.0), (b, 8.0), (b, 8.2), (a, 8.2)))
        for a, b in ((-1.0, 2.0), (2.7, 7.0))
    )
    place = HALLWAY.model_copy(update={"obstacles": walls})
    sight, rng, n_hidden = Sight(place), np.random.default_rng(5), 0
    for _ in range(60):
        (x_m, y_m), to = rng.uniform((0.4, 6.0), (5.6, 7.6)), rng.uniform((0.4, 8.6), (5.6, 10.0))
        aim = sight.aim(observation_at(x_m, y_m), Waypoint(*to.tolist()))
        n_hidden += (aim.x_m, aim.y_m) != tuple(to)
        if math.dist((x_m, y_m), (aim.x_m, aim.y_m)) < 0.4:
            continue  # the way is followed at least as far
        line_m = np.linspace((x_m, y_m), (aim.x_m, aim.y_m), 50)
        assert distance_to_segments_m(line_m, place.wall_segments_m).min() > place.robot.radius_m
    assert n_hidden > 30


def test_a_standing_person_in_the_way_is_never_touched_and_is_passed(planner):
    person = (3.0, 8.0)
    poses, _ = drive(planner, (1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 160, people=[person])
    gap = np.hypot(*(poses[:, :2] - person).T) - 0.5
    assert gap.min() > 0.0
    assert np.hypot(*(poses[-1, :2] - [4.5, 8.0])) < 0.15


def test_a_wall_of_standing_people_makes_the_robot_wait_in_front_of_it(planner):
    row = [(3.0, y) for y in np.arange(0.2, 16.0, 0.55)]
    poses, speeds = drive(planner, (1.5, 8.0, 0.0), Waypoint(4.5, 8.0), 100, people=row)
    assert poses[:, 0].max() < 2.5
    assert np.abs(speeds[-20:]).max() < 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_with_its_back_to_a_waypoint_turns_in_place_by_the_shorter_way(planner, side):
    command = planner.step(observation_at(3.0, 8.0, side * 2.5), Waypoint(4.0, 8.0))
    assert (command.linear_mps, np.sign(command.angular_radps)) == (0.0, -side)


def test_a_person_who_leans_on_the_robot_does_not_keep_it_from_leaving(planner):
    observation = observation_at(2.0, 8.0, 0.0, people=[(1.55, 8.0)], velocity=[(0.2, 0.0)])
    assert planner.step(observation, Waypoint(4.0, 8.0)).linear_mps > 0.1


PLANNER = make_planner(HALLWAY)


@settings(max_examples=40)
@given(
    place=st.tuples(st.floats(0.3, 5.7), st.floats(0.3, 23.7), st.floats(-math.pi, math.pi)),
    speeds=st.tuples(st.floats(-0.3, 1.2), st.floats(-3.5, 3.5)),
    people=st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 4), max_size=12),
    to=st.tuples(*[st.floats(-2.0, 2.0)] * 2),
)
def test_whatever_is_seen_the_command_is_finite_and_within_the_robots_limits(
    place, speeds, people, to
):
    rows = np.array(people, dtype=float).reshape(-1, 4)
    motion = dict(zip(("speed_mps", "yaw_rate_radps"), speeds, strict=True))
    seen = observation_at(*place, **motion, people=rows[:, :2] + place[:2], velocity=rows[:, 2:])
    command = PLANNER.step(seen, Waypoint(place[0] + to[0], place[1] + to[1]))
    robot = HALLWAY.robot
    assert command.is_finite
    assert robot.min_vel_x_mps <= command.linear_mps <= robot.max_vel_x_mps + 1e-9
    assert abs(command.angular_radps) <= robot.max_vel_theta_radps + 1e-9


def test_the_robot_arrives_among_many_people_against_the_flow():
    row = run_task(EpisodeTask("crossing", 3, n_people=60, driver="expert_against_flow"))
    assert row["outcome"] == "arrived"
    assert row["robot_on_wall"] == 0


AHEAD = Waypoint(3.0, 10.0)
ON, BACK, TURN = Command(0.5, 0.0), Command(-0.15, 0.0), Command(0.0, 1.5)


class PushingPlanner:
    """Always commands the same on its way; reports the given is_blocked."""

    def __init__(self, is_blocked=False, command=ON):
        self.is_blocked, self.command = is_blocked, command

    def reset(self):
        pass

    def step(self, _observation, waypoint):
        return STOP if waypoint is None else self.command


def standing_at(time_s, x_m=3.0, y_m=8.0, yaw_rad=0.0, people=()):
    return observation_at(x_m, y_m, yaw_rad, time_s=time_s, people=people)


def test_a_move_is_one_beyond_the_radius_and_starts_the_allowance_anew():
    """Of 0.5 m and 10 s."""
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    way = [(0.0, 3.0), (4.0, 3.5), (6.0, 3.75), (10.5, 3.25), (16.0, 3.25), (16.5, 3.25)]
    commands = [planner.step(standing_at(*each), AHEAD) for each in way]
    assert commands == [ON] * 5 + [BACK]


def test_a_robot_that_must_not_reverse_turns_first_no_faster_than_it_can():
    settings = PlannerSettings(spin_dist=3.0, max_rotational_vel=9.0, wait_duration=4.0)
    limits = HALLWAY.robot.model_copy(update={"min_vel_x_mps": 0.0})
    turn = Behaviour(Command(0.0, 3.5), 3.0)
    assert behaviours_of(settings, limits) == (turn, Behaviour(STOP, 4.0))


def quarters(n):
    """(n,) times whose steps of a quarter of a second are exact."""
    return [0.25 * tick for tick in range(n)]


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_each_recovery_begins_beyond_the_allowance_and_ends_once_it_is_done(share):
    """10 s of allowance each; 0.225 m backward, 1.5 rad, 2 s of waiting, and anew.

    share: of the commands that the robot does; a recovery ends after four times its duration.
    After a move of 1 m as many recoveries are tried again before they count as failed.
    """
    none, failed = PlannerStatus.NONE, PlannerStatus.FAILED_TO_MAKE_PROGRESS
    back_s, turn_s = (min(each / max(share, 1e-9), 4.0 * each) for each in (1.5, 1.0))
    end_s, expected = 0.0, [(0.0, ON, 0, none)]
    for n, (command, lasts_s) in enumerate(
        [(BACK, back_s), (TURN, turn_s), (STOP, 2.0), (BACK, back_s)], start=1
    ):
        begin_s, end_s = end_s + 10.25, end_s + 10.25 + lasts_s
        status = failed if n == 4 else none
        expected += [(begin_s, command, n, status), (end_s, ON, n, status)]
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    changes, before, failed_of, pose = [], None, {}, (3.0, 8.0, 0.0)
    for time_s in quarters(720):
        if time_s == end_s + 3.0:
            pose = pose[0] + 1.0, *pose[1:]
        command = planner.step(standing_at(time_s, *pose), AHEAD)
        if command != ON:
            done = 0.25 * share * command.linear_mps, 0.0, 0.25 * share * command.angular_radps
            pose = compose(pose, done)
        seen = (command, planner.n_recoveries, planner.status)
        if seen != before:
            changes.append((time_s, *seen))
        before = seen
        failed_of.setdefault(planner.n_recoveries, planner.status)
    assert changes[:9] == expected
    assert {n: failed_of[n] for n in range(10)} == {
        n: failed if n in (4, 8, 9) else none for n in range(10)
    }


def test_noise_of_the_pose_is_no_recovery_that_was_done():
    planner, rng = RecoveringPlanner(PushingPlanner(), HALLWAY), np.random.default_rng(0)
    backs_s = []
    for time_s in 0.05 * np.arange(400):
        x_m, yaw_rad = 0.01 * rng.standard_normal(2)
        if planner.step(standing_at(time_s, 3.0 + x_m, yaw_rad=yaw_rad), AHEAD) == BACK:
            backs_s.append(time_s)
    assert backs_s[-1] - backs_s[0] > 5.0


@pytest.mark.parametrize("yaw_rad", [0.7, -2.0])
def test_the_space_behind_the_robot_is_a_disc_of_its_size(yaw_rad):
    """Its middle is 0.35 m behind the robot; the person must be 0.25 m + 0.25 m away from it."""
    forward = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    sideways = np.array([-forward[1], forward[0]])
    for direction in (-forward, sideways, (-sideways - forward) / math.sqrt(2.0)):
        for away_m, backs_off in ((0.49, False), (0.51, True)):
            person = np.array([3.0, 8.0]) - 0.35 * forward + away_m * direction
            people = [(3.0, 12.0), person, (3.0, 4.0)]
            assert has_backed_off(HALLWAY, yaw_rad=yaw_rad, people=people) == backs_off


def has_backed_off(scenario, **place):
    planner = RecoveringPlanner(PushingPlanner(), scenario)
    return BACK in [planner.step(standing_at(t, **place), AHEAD) for t in quarters(45)]


@pytest.mark.parametrize(
    ("x_m", "yaw_rad", "backs_off"),
    [(5.42, math.pi, False), (5.38, math.pi, True), (5.7, 0.0, True), (5.68, -math.pi / 2, True)],
)
def test_a_wall_is_behind_where_the_disc_would_reach_it(x_m, yaw_rad, backs_off):
    """The hallway ends at x = 6 m."""
    assert has_backed_off(HALLWAY, x_m=x_m, yaw_rad=yaw_rad) == backs_off


def test_a_robot_backs_off_until_a_person_comes_behind_it_and_then_has_a_new_allowance():
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    commands = {
        t: planner.step(standing_at(t, people=[(2.2, 8.0)] if t >= 11.0 else ()), AHEAD)
        for t in quarters(90)
    }
    assert [t for t, command in commands.items() if command == BACK] == [10.25, 10.5, 10.75]
    turns_s = [t for t, command in commands.items() if command == TURN]
    assert turns_s == [21.25, 21.5, 21.75, 22.0, 22.25]


def test_patience_is_exceeded_after_the_tolerance_of_one_blockage_and_not_of_two():
    blocked = PushingPlanner()
    planner = RecoveringPlanner(blocked, HALLWAY)
    for time_s in quarters(40):
        blocked.is_blocked = time_s not in (0.0, 1.0)
        assert planner.is_blocked == blocked.is_blocked
        planner.step(standing_at(time_s), AHEAD)
        waits = PlannerStatus.NO_VALID_CONTROL
        waits = waits if time_s <= 6.25 else PlannerStatus.PATIENCE_EXCEEDED
        assert planner.status == (waits if blocked.is_blocked else PlannerStatus.NONE)


@pytest.mark.parametrize("way", ["reset", "arrival", "no waypoint"])
def test_after_a_reset_or_an_arrival_everything_begins_anew(way):
    """A robot that is blocked fails, and its fifth recovery begins at 69.25 s."""
    planner = RecoveringPlanner(PushingPlanner(is_blocked=True), HALLWAY)

    def drive(first_s):
        times_s = [first_s + t for t in quarters(278)]
        return [(planner.step(standing_at(t), AHEAD), planner.status) for t in times_s]

    first = drive(0.0)
    assert first[-1] == (TURN, PlannerStatus.FAILED_TO_MAKE_PROGRESS)
    if way == "reset":
        planner.reset()
    elif way == "arrival":
        assert planner.step(standing_at(70.0, y_m=9.9), AHEAD) == ON
    else:
        assert planner.step(standing_at(71.25), None) == STOP
        assert planner.status != PlannerStatus.NONE, "a waypoint that is late by 2 s is the same"
        assert planner.step(standing_at(71.5), None) == STOP
    assert planner.status == PlannerStatus.NONE
    assert drive(72.0) == first


@pytest.mark.parametrize(
    ("cell_size_m", "to_m", "n_recoveries"),
    [(1.0, (0.25, 0.0), 1), (1.0, (0.0, -0.249), 0), (0.24, (0.0, -0.24), 1)],
)
def test_a_robot_may_stand_nearer_to_its_waypoint_than_a_quarter_of_a_metre(
    cell_size_m, to_m, n_recoveries
):
    """Where cells are small, the waypoint in the next cell is not reached."""
    scenario = HALLWAY.model_copy(update={"cell_size_m": cell_size_m})
    planner = RecoveringPlanner(PushingPlanner(command=STOP), scenario)
    for time_s in quarters(45):
        planner.step(standing_at(time_s), Waypoint(3.0 + to_m[0], 8.0 + to_m[1]))
    assert planner.n_recoveries == n_recoveries


@pytest.mark.parametrize("lost", ["x_m", "yaw_rad"])
def test_a_robot_without_a_pose_stops_without_a_step_of_its_planner(lost):
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    assert planner.step(standing_at(0.0, **{lost: math.nan}), AHEAD) == STOP
    assert planner.status == PlannerStatus.NO_VALID_CONTROL
    assert planner.step(standing_at(0.25), AHEAD) == ON
    assert planner.status == PlannerStatus.NONE


KINEMATIC = load_scenario("hallway").with_values("robot", drive="kinematic")
EMPTY = KINEMATIC.with_pedestrian_count(0)
NORTHWARD = Waypoint(3.0, 12.0)


def with_parameters(**parameters):
    return EMPTY.with_local_planner(PlannerSettings(**parameters))


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
    assert driven(EMPTY)[:, 0].max() > 0.8


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
    scenario = EMPTY.with_local_planner(parameters)
    planner, people, found = make_planner(scenario), [(3.2, 9.2), (2.4, 9.8)], []
    for y_m, yaw_rad in ((8.0, 1.2), (8.0, -0.5), (10.5, 0.3), (11.88, 1.2)):
        observation = observation_at(3.0, y_m, yaw_rad, speed_mps=0.3, people=people)
        found.append(planner.step(observation, NORTHWARD))
    stuck = RecoveringPlanner(PushingPlanner(is_blocked=True), scenario)
    for tick in range(500):
        x_m = 3.6 if tick < 150 and tick // 25 % 2 else 3.0  # 0.6 m to and fro, then at rest
        command = stuck.step(observation_at(x_m, 8.0, time_s=0.2 * tick), NORTHWARD)
        found.append((command, stuck.status, stuck.n_recoveries))
    return found


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
        make_planner(EMPTY.with_values("local_planner", **parameters))
