"""What a live planner follows, and where it stands when waypoints or intents stop coming."""

import pytest

from serd_core.grid.grid import Action
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import FollowedDirective, Waypoint
from support.observations import observation_at

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
