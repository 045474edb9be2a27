"""What a live planner follows, and where it stands when waypoints or intents stop coming."""

import pytest

from serd_core.grid.grid import Action
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.directive import FollowedDirective
from serd_sim.world.waypoint import Waypoint
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
FAR = Waypoint(2.5, 12.5)


@pytest.fixture
def followed():
    return FollowedDirective(HALLWAY)


def test_without_a_directive_the_robot_stands(followed):
    assert not followed.is_given
    assert followed.waypoint(observation_at(2.5, 3.5)) is None
    assert not followed.is_overdue


def test_an_intent_means_a_waypoint_straight_ahead_and_wait_means_to_stand(followed):
    followed.take(4.0, Action.NORTH)
    assert followed.waypoint(observation_at(2.2, 3.9, time_s=4.0)) == Waypoint(2.5, 5.5)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=4.5)) == Waypoint(2.5, 5.5)
    followed.take(6.0, Action.WAIT)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=6.0)) is None


@pytest.mark.parametrize(("time_s", "waypoint"), [(4.75, FAR), (4.85, None), (60.0, None)])
def test_a_waypoint_that_is_not_repeated_is_followed_for_a_moment(followed, time_s, waypoint):
    followed.take(4.0, FAR)
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=time_s)) == waypoint
    assert followed.is_overdue == (waypoint is None)


def test_a_waypoint_is_followed_as_long_where_the_robot_enters_another_cell(followed):
    followed.take(4.0, FAR)
    followed.waypoint(observation_at(2.5, 3.95, time_s=4.0))
    for time_s, y_m in ((4.1, 4.15), (4.6, 4.7), (4.75, 4.9)):
        assert followed.waypoint(observation_at(2.5, y_m, time_s=time_s)) == FAR
    assert followed.waypoint(observation_at(2.5, 4.9, time_s=4.85)) is None


@pytest.mark.parametrize(("late_s", "is_followed"), [(3.95, True), (4.05, False)])
def test_an_intent_is_followed_in_its_cell_for_the_patience_of_the_scenario(
    followed, late_s, is_followed
):
    followed.take(4.0, Action.NORTH)
    followed.waypoint(observation_at(2.5, 3.6, time_s=4.0))
    seen = observation_at(2.5, 3.7, time_s=4.0 + late_s)
    assert followed.waypoint(seen) == (Waypoint(2.5, 5.5) if is_followed else None)
    assert followed.is_overdue != is_followed


def test_one_intent_drives_the_robot_one_cell_on_and_no_farther(followed):
    followed.take(4.0, Action.NORTH)
    followed.waypoint(observation_at(2.5, 3.6, time_s=4.0))
    for time_s, y_m in ((5.0, 3.9), (5.2, 4.08), (5.3, 4.2), (5.55, 4.4)):
        assert followed.waypoint(observation_at(2.5, y_m, time_s=time_s)) == Waypoint(2.5, 5.5)
    assert followed.waypoint(observation_at(2.5, 4.5, time_s=5.65)) is None
    assert followed.is_overdue
    assert followed.waypoint(observation_at(2.5, 3.5, time_s=6.5)) is None, "also back in its cell"


def test_an_intent_that_is_repeated_keeps_the_robot_going(followed):
    for number in range(20):
        seen = observation_at(2.5, 3.6 + 0.2 * number, time_s=4.0 + 0.2 * number)
        followed.take(seen.time_s, Action.NORTH)
        waypoint = followed.waypoint(seen)
        assert waypoint is not None
        assert waypoint.y_m - seen.y_m > 1.0


def test_a_scenario_with_little_patience_follows_an_intent_no_shorter_than_a_waypoint():
    followed = FollowedDirective(HALLWAY.model_copy(update={"patience_s": 0.2}))
    followed.take(4.0, Action.NORTH)
    for late_s, waypoint in ((0.0, Waypoint(2.5, 5.5)), (0.75, Waypoint(2.5, 5.5)), (0.85, None)):
        assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0 + late_s)) == waypoint


@pytest.mark.parametrize(("stamp_s", "directive"), [(0.0, FAR), (1.7e9, FAR), (0.0, Action.NORTH)])
def test_a_directive_that_is_old_or_of_another_clock_is_not_followed(followed, stamp_s, directive):
    followed.take(stamp_s, directive)
    now = observation_at(2.2, 3.9, time_s=50.0)
    assert followed.waypoint(now) is None
    assert followed.is_overdue
    followed.take(50.0, FAR)
    assert followed.waypoint(now) == FAR
    assert not followed.is_overdue


def test_a_robot_that_is_to_wait_is_never_overdue(followed):
    followed.take(0.0, Action.WAIT)
    assert followed.waypoint(observation_at(2.2, 3.9, time_s=50.0)) is None
    assert not followed.is_overdue


def test_clear_discards_the_directive_and_stand_only_its_waypoint(followed):
    followed.take(4.0, FAR)
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    followed.stand()
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) is None
    followed.clear()
    assert not followed.is_given
