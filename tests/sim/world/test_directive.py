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


def test_an_intent_means_the_next_cell_and_wait_means_to_stand(followed):
    followed.take(4.0, Action.NORTH)
    assert followed.waypoint(observation_at(2.2, 3.9, time_s=4.0)) == Waypoint(2.5, 4.5)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=4.5)) == Waypoint(2.5, 4.5)
    followed.take(6.0, Action.WAIT)
    assert followed.waypoint(observation_at(2.2, 4.1, time_s=6.0)) is None


@pytest.mark.parametrize(("time_s", "waypoint"), [(4.75, FAR), (4.85, None), (60.0, None)])
def test_a_waypoint_that_is_not_repeated_is_followed_for_a_moment(followed, time_s, waypoint):
    followed.take(4.0, FAR)
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=4.0)) == FAR
    assert followed.waypoint(observation_at(2.5, 3.6, time_s=time_s)) == waypoint
    assert followed.is_overdue == (waypoint is None)


@pytest.mark.parametrize(("period_s", "patience_s"), [(0.05, 0.8), (1.0, 1.5), (9.0, 3.0)])
def test_a_source_of_actions_is_missed_after_one_and_a_half_of_its_own_periods(
    followed, period_s, patience_s
):
    last_s = 4.0 + 5 * period_s
    for number in range(6):
        followed.take(4.0 + number * period_s, Action.NORTH)
    for late_s, waypoint in ((patience_s - 0.01, Waypoint(2.5, 4.5)), (patience_s + 0.01, None)):
        assert followed.waypoint(observation_at(2.5, 3.6, time_s=last_s + late_s)) == waypoint
    followed.take(last_s + 9.0, Action.NORTH)
    seen = observation_at(2.5, 3.6, time_s=last_s + 9.0)
    assert followed.waypoint(seen) == Waypoint(2.5, 4.5)


def test_the_longest_of_the_last_pauses_counts(followed):
    for time_s in (4.0, 4.2, 4.4, 5.4, 5.6):
        followed.take(time_s, Action.NORTH)
    assert followed.patience_s == pytest.approx(1.5)


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
