"""What a live planner follows, and where it stands when waypoints or intents stop coming."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_core.grid.grid import Action
from sim.scenario.grid import grid_of
from sim.scenario.scenario import load_scenario
from sim.world.directive import FollowedDirective
from sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)
FAR = Waypoint(2.5, 12.5)


@pytest.fixture
def followed():
    return FollowedDirective(HALLWAY)


def test_without_a_directive_the_robot_stands(followed):
    assert not followed.is_given
    assert followed.waypoint(observation_at(2.5, 3.5)) is None
    assert not followed.is_overdue


def test_an_intent_means_the_next_cell_and_wait_means_to_stand(followed):
    followed.take(4.0, Action.NORTH)
    assert followed.waypoint(observation_at(2.2, 3.9, time_s=4.0)) == Waypoint(2.5, 4.5)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=4.5)) == Waypoint(2.5, 4.5)
    followed.take(6.0, Action.WAIT)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=6.0)) is None


@pytest.mark.parametrize(
    ("time_s", "waypoint"), [(6.95, FAR), (7.05, Waypoint(2.5, 4.5)), (60.0, Waypoint(2.5, 4.5))]
)
def test_after_one_and_a_half_periods_the_next_centre_is_the_last_waypoint(
    followed, time_s, waypoint
):
    followed.take(4.0, FAR)
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=time_s)) == waypoint
    assert followed.is_overdue == (waypoint != FAR)
    later = observation_at(2.5, 4.6, time_s=time_s + 1.0)
    assert followed.waypoint(later) == waypoint or waypoint == FAR


def test_a_centre_that_is_too_near_to_stop_at_is_passed(followed):
    followed.take(0.0, FAR)
    fast = observation_at(2.5, 3.4, math.pi / 2, time_s=50.0, speed_mps=1.2)
    assert followed.waypoint(fast) == Waypoint(2.5, 4.5)
    slow = FollowedDirective(HALLWAY)
    slow.take(0.0, FAR)
    assert slow.waypoint(observation_at(2.5, 3.4, time_s=50.0)) == Waypoint(2.5, 3.5)


@pytest.mark.parametrize("stamp_s", [0.0, 1.7e9])
def test_an_intent_without_a_valid_stamp_drives_one_cell_and_is_overdue(followed, stamp_s):
    followed.take(stamp_s, Action.NORTH)
    assert followed.waypoint(observation_at(2.2, 3.9, time_s=50.0)) == Waypoint(2.5, 4.5)
    assert followed.is_overdue


def test_a_new_directive_ends_the_delay(followed):
    followed.take(0.0, FAR)
    followed.waypoint(observation_at(2.5, 3.6, time_s=50.0))
    followed.take(50.0, FAR)
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=50.0)) == FAR
    assert not followed.is_overdue


def test_clear_discards_the_directive_and_stand_only_its_waypoint(followed):
    followed.take(4.0, FAR)
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) is None
    followed.clear()
    assert not followed.is_given


@given(
    st.integers(0, len(GRID.centers_m) - 1),
    st.integers(0, len(GRID.centers_m) - 1),
    st.floats(-0.45, 0.45),
    st.floats(-0.45, 0.45),
    st.floats(0.0, 1.2),
)
def test_an_old_waypoint_is_never_farther_than_the_next_cells(here, there, east, north, speed_mps):
    x_m, y_m = GRID.centers_m[here]
    robot = observation_at(x_m + east, y_m + north, time_s=50.0, speed_mps=speed_mps)
    waypoint = Waypoint(*map(float, GRID.centers_m[there]))
    followed = FollowedDirective(HALLWAY)
    followed.take(0.0, waypoint)
    found = followed.waypoint(robot)
    if found is None:
        return  # a wall is in between
    before_m = math.hypot(waypoint.x_m - robot.x_m, waypoint.y_m - robot.y_m)
    assert math.hypot(found.x_m - robot.x_m, found.y_m - robot.y_m) <= 1.6 * GRID.cell_size_m
    left_m = math.hypot(found.x_m - waypoint.x_m, found.y_m - waypoint.y_m)
    assert left_m <= before_m


def test_off_the_grid_a_far_waypoint_is_not_followed(followed):
    followed.take(0.0, FAR)
    assert followed.waypoint(observation_at(-50.0, 3.5, time_s=50.0)) is None
