"""Progress check, recoveries and status."""

import math

import numpy as np
import pytest

from serd_sim.planning.local_planner import PlannerStatus, RecoveringPlanner, behaviours_of
from serd_sim.planning.settings import PlannerSettings
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
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


@pytest.mark.parametrize(
    ("speeds", "limits", "expected"),
    [
        ((0.1, 0.5), {}, [(-0.1, 0.0, 3.0), (0.0, 0.5, 6.0), (0.0, 0.0, 4.0)]),
        ((2.0, 9.0), {}, [(-0.3, 0.0, 1.0), (0.0, 3.5, 3.0 / 3.5), (0.0, 0.0, 4.0)]),
        ((0.1, 0.5), {"min_vel_x_mps": 0.0}, [(0.0, 0.5, 6.0), (0.0, 0.0, 4.0)]),
    ],
)
def test_recoveries_last_as_long_as_their_way_takes_at_their_speed(speeds, limits, expected):
    """A back-up of 0.3 m and a turn of 3 rad; the limits are 0.3 m/s backward and 3.5 rad/s."""
    settings = PlannerSettings(
        backup_dist=0.3, spin_dist=3.0, wait_duration=4.0,
        backup_speed=speeds[0], max_rotational_vel=speeds[1],
    )  # fmt: skip
    assert behaviours_of(settings, HALLWAY.robot.model_copy(update=limits)) == tuple(
        (Command(speed, turn), pytest.approx(duration_s)) for speed, turn, duration_s in expected
    )


def quarters(n):
    """(n,) times whose steps of a quarter of a second are exact."""
    return [0.25 * tick for tick in range(n)]


def test_each_recovery_begins_beyond_the_allowance_and_ends_after_its_duration():
    """10 s of allowance each; 1.5 s backward, 1 s of turning, 2 s of waiting, and anew.

    After a move of 1 m as many recoveries are tried again before they count as failed.
    """
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    changes, before, failed_of = [], None, {}
    for time_s in quarters(460):
        x_m = 3.0 if time_s < 50.0 else 4.0
        command = planner.step(standing_at(time_s, x_m), AHEAD)
        seen = (command, planner.n_recoveries, planner.status)
        if seen != before:
            changes.append((time_s, *seen))
        before = seen
        failed_of.setdefault(planner.n_recoveries, planner.status)
    none, failed = PlannerStatus.NONE, PlannerStatus.FAILED_TO_MAKE_PROGRESS
    assert changes[:9] == [
        (0.0, ON, 0, none),
        (10.25, BACK, 1, none), (11.75, ON, 1, none),
        (22.0, TURN, 2, none), (23.0, ON, 2, none),
        (33.25, STOP, 3, none), (35.25, ON, 3, none),
        (45.5, BACK, 4, failed), (47.0, ON, 4, failed),
    ]  # fmt: skip
    assert failed_of == {n: failed if n in (4, 8, 9) else none for n in range(10)}


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
    """The hallway ends at x = 6 m; its raster has cells of 0.05 m."""
    assert has_backed_off(HALLWAY, x_m=x_m, yaw_rad=yaw_rad) == backs_off


def test_touching_a_person_or_a_wall_behind_is_no_free_space():
    """From x = 2.85 m the disc has its middle at 2.5 m, exactly; walls are as near as cells are."""
    assert not has_backed_off(HALLWAY, x_m=2.85, people=[(2.0, 8.0)])
    away_m = float(wall_distance_raster(HALLWAY).at(np.array([5.77]), np.array([8.0]))[0])
    for radius_m, backs_off in ((away_m, False), (away_m - 1e-9, True)):
        scenario = HALLWAY.with_values("robot", radius_m=radius_m)
        assert has_backed_off(scenario, x_m=5.42, yaw_rad=math.pi) == backs_off


def test_a_robot_backs_off_until_a_person_comes_behind_it_and_then_has_a_new_allowance():
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    commands = {
        t: planner.step(standing_at(t, people=[(2.2, 8.0)] if t >= 11.0 else ()), AHEAD)
        for t in quarters(90)
    }
    assert [t for t, command in commands.items() if command == BACK] == [10.25, 10.5, 10.75]
    assert [t for t, command in commands.items() if command == TURN] == [21.25, 21.5, 21.75, 22.0]


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
    """A robot that is blocked fails, and its fifth recovery begins at 57.25 s."""
    planner = RecoveringPlanner(PushingPlanner(is_blocked=True), HALLWAY)

    def drive(first_s):
        times_s = [first_s + t for t in quarters(230)]
        return [(planner.step(standing_at(t), AHEAD), planner.status) for t in times_s]

    first = drive(0.0)
    assert first[-1] == (TURN, PlannerStatus.FAILED_TO_MAKE_PROGRESS)
    if way == "reset":
        planner.reset()
    elif way == "arrival":
        assert planner.step(standing_at(58.0, y_m=9.9), AHEAD) == ON
    else:
        assert planner.step(standing_at(58.0), None) == STOP
    assert planner.status == PlannerStatus.NONE
    assert drive(60.0) == first


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


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, (0.5, 1.0)),
        ({"acc_lim_x": 1.0}, (0.05, 0.6)),
        ({"acc_lim_x": 1.0, "acc_lim_theta": 2.0}, (0.05, 0.1)),
    ],
)
def test_commands_change_by_the_accelerations_of_the_parameters_where_one_is_below_the_robots(
    parameters, expected
):
    """In a period of 0.05 s; the robot has 2.5 m/s2 and 12 rad/s2."""
    scenario = HALLWAY.with_local_planner(PlannerSettings(**parameters))
    planner = RecoveringPlanner(PushingPlanner(command=Command(0.5, 1.0)), scenario)
    command = planner.step(standing_at(0.0), AHEAD)
    assert (command.linear_mps, command.angular_radps) == pytest.approx(expected)


@pytest.mark.parametrize("lost", ["x_m", "yaw_rad"])
def test_a_robot_without_a_pose_stops_without_a_step_of_its_planner(lost):
    planner = RecoveringPlanner(PushingPlanner(), HALLWAY)
    assert planner.step(standing_at(0.0, **{lost: math.nan}), AHEAD) == STOP
    assert planner.status == PlannerStatus.NO_VALID_CONTROL
    assert planner.step(standing_at(0.25), AHEAD) == ON
    assert planner.status == PlannerStatus.NONE
