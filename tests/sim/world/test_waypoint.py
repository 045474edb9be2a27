"""From a decision to a waypoint, and what a world commands of a commander that fails."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_core.grid.grid import Action
from serd_files.errors import USER_ERRORS
from serd_sim.drivers.catalogue import MOVES
from serd_sim.errors import SimError
from serd_sim.scenario.cells import cells_with_clearance
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command, CommandGuard
from serd_sim.world.waypoint import FollowedDirective, Waypoint, action_towards, waypoint_of_intent
from support.observations import observation_at

CELLS = load_scenario("hallway").cells


@pytest.mark.parametrize(
    ("place", "action", "expected"),
    [
        ((2.2, 3.9), Action.NORTH, Waypoint(2.5, 5.5)),
        ((3.2, 3.9), Action.WEST, Waypoint(1.5, 3.5)),
        ((1.2, 3.9), Action.WEST, Waypoint(0.5, 3.5)),  # the last cell before a wall
        ((0.2, 3.9), Action.WEST, Waypoint(0.5, 3.5)),
        ((2.2, 3.9), Action.WAIT, None),
        ((-0.1, 3.9), Action.NORTH, Waypoint(0.5, 5.5)),  # pushed into a wall: the nearest cell
    ],
)
def test_a_move_goes_straight_on_to_a_cell_a_metre_beyond_the_next_one(place, action, expected):
    assert waypoint_of_intent(CELLS, observation_at(*place), action) == expected


@pytest.mark.parametrize(("cell_size_m", "n_cells"), [(0.3, 5), (0.5, 3), (2.0, 2)])
def test_the_waypoint_is_a_metre_beyond_the_next_cell_whatever_the_size_of_cells(
    cell_size_m, n_cells
):
    corridor = cell_size_m * np.array([[0, 0], [20, 0], [20, 1], [0, 1]])
    cells = cells_with_clearance(corridor, (), cell_size_m, 0.0)
    start = observation_at(0.5 * cell_size_m, 0.5 * cell_size_m)
    ahead = waypoint_of_intent(cells, start, Action.EAST)
    expected = (0.5 + n_cells) * cell_size_m, 0.5 * cell_size_m
    assert (ahead.x_m, ahead.y_m) == pytest.approx(expected)


@pytest.mark.parametrize("action", MOVES)
def test_the_waypoint_of_an_action_lies_in_its_direction(action):
    here = observation_at(2.5, 4.5)
    assert action_towards(waypoint_of_intent(CELLS, here, action), here) == action


@pytest.mark.parametrize("point", [(math.nan, 1.0), (1.0, math.inf), (-1e300, 1.0)])
def test_a_waypoint_that_is_no_point_is_refused(point):
    with pytest.raises(SimError, match=rf"got \({point[0]}, {point[1]}\)".replace("+", r"\+")):
        Waypoint(*point)


def test_a_fresh_command_passes_and_a_silent_or_broken_commander_stops_the_robot():
    guard, drive = CommandGuard(), Command(0.5, 0.1)
    assert guard.current(3.0) == STOP
    guard.receive(drive, 10.0)
    assert [guard.current(at_s) for at_s in (10.5, 10.55, 9.0)] == [drive, STOP, STOP]
    assert guard.is_stale(10.55)
    guard.receive(Command(math.nan, 0.0), 10.55)
    assert guard.current(10.55) == STOP
    assert guard.n_rejected == 1


HALLWAY = load_scenario("hallway")
FAR, NEXT = Waypoint(2.5, 12.5), Waypoint(2.5, 5.5)


@pytest.fixture
def followed():
    return FollowedDirective(HALLWAY)


@pytest.mark.parametrize(
    ("directive", "patience_s", "seen"),
    [
        # A waypoint that is not repeated is followed for a moment, also in another cell.
        (FAR, 4.0, [(4.0, 3.6, FAR), (4.75, 3.6, FAR), (4.85, 3.6, None), (60.0, 3.6, None)]),
        (FAR, 4.0, [(4.0, 3.95, FAR), (4.1, 4.15, FAR), (4.75, 4.9, FAR), (4.85, 4.9, None)]),
        # An intent is followed in its cell for the patience of the scenario, and one cell on.
        (Action.NORTH, 4.0, [(4.0, 3.6, NEXT), (7.95, 3.7, NEXT), (8.05, 3.7, None)]),
        (Action.NORTH, 4.0, [(4.0, 3.6, NEXT), (5.0, 3.9, NEXT), (5.3, 4.2, NEXT),
                             (5.55, 4.4, NEXT), (5.65, 4.5, None), (6.5, 3.5, None)]),
        (Action.NORTH, 0.2, [(4.0, 3.6, NEXT), (4.75, 3.6, NEXT), (4.85, 3.6, None)]),
        # One that is old or of another clock is not.
        (FAR, 4.0, [(54.0, 3.6, None)]),
        (FAR, 4.0, [(1.0, 3.6, None)]),
        (Action.NORTH, 4.0, [(54.0, 3.6, None)]),
    ],
)  # fmt: skip
def test_a_directive_is_followed_as_long_as_it_may_be_and_overdue_then(directive, patience_s, seen):
    followed = FollowedDirective(HALLWAY.model_copy(update={"patience_s": patience_s}))
    followed.take(4.0, directive)
    for time_s, y_m, waypoint in seen:
        assert followed.waypoint(observation_at(2.5, y_m, time_s=time_s)) == waypoint
        assert followed.is_overdue == (waypoint is None)
    followed.take(time_s, FAR)
    assert followed.waypoint(observation_at(2.5, y_m, time_s=time_s)) == FAR
    assert not followed.is_overdue


def test_an_intent_that_is_repeated_keeps_the_robot_going(followed):
    for number in range(20):
        seen = observation_at(2.5, 3.6 + 0.2 * number, time_s=4.0 + 0.2 * number)
        followed.take(seen.time_s, Action.NORTH)
        assert followed.waypoint(seen).y_m - seen.y_m > 1.0


def test_a_robot_without_a_directive_or_that_is_to_wait_stands_and_is_never_overdue(followed):
    assert not followed.is_given
    for time_s in (4.0, 50.0):
        assert followed.waypoint(observation_at(2.2, 3.9, time_s=time_s)) is None
        assert not followed.is_overdue
        followed.take(4.0, Action.WAIT)


def test_clear_discards_the_directive_and_stand_only_its_waypoint(followed):
    followed.take(4.0, FAR)
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) is None
    followed.clear()
    assert not followed.is_given


@given(yaw=st.floats(-math.pi, math.pi), seed=st.integers(0, 1000))
def test_yaw_by_quaternion_and_people_by_float32_come_back_unchanged(yaw, seed):
    people, velocity = np.random.default_rng(seed).normal(size=(2, 5, 2))
    first = observation_at(1.0 / 3.0, 2.0, yaw, people=people, velocity=velocity)
    yaw = 2.0 * math.atan2(math.sin(0.5 * first.yaw_rad), math.cos(0.5 * first.yaw_rad))
    people, velocity = (each.astype(np.float32) for each in (people, velocity))
    again = observation_at(1.0 / 3.0, 2.0, yaw, people=people, velocity=velocity)
    assert again.pose == first.pose
    np.testing.assert_array_equal(again.people_position_m, first.people_position_m)
    np.testing.assert_array_equal(again.people_velocity_mps, first.people_velocity_mps)


def test_people_columns_of_different_length_are_refused():
    with pytest.raises(USER_ERRORS, match="one row per person"):
        observation_at(0.0, 0.0, people=np.zeros((2, 2)), velocity=np.zeros((3, 2)))
