"""From a decision to a waypoint."""

import math
import re

import pytest

from serd_core.grid.grid import Action
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import (
    DecisionClock,
    Waypoint,
    is_decision_tick,
    waypoint_of_intent,
)
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


def test_a_move_goes_to_the_centre_of_the_next_cell():
    assert waypoint_of_intent(GRID, observation_at(2.2, 3.9), Action.NORTH) == Waypoint(2.5, 4.5)
    assert waypoint_of_intent(GRID, observation_at(2.2, 3.9), Action.WEST) == Waypoint(1.5, 3.5)


def test_waiting_stays_and_a_move_into_a_wall_goes_to_the_own_centre():
    assert waypoint_of_intent(GRID, observation_at(2.2, 3.9), Action.WAIT) == Waypoint(2.2, 3.9)
    assert waypoint_of_intent(GRID, observation_at(0.2, 3.9), Action.WEST) == Waypoint(0.5, 3.5)


def test_decisions_are_taken_every_40_ticks():
    ticks = [
        tick for tick in range(100) if is_decision_tick(observation_at(1, 1, tick=tick), HALLWAY)
    ]
    assert ticks == [0, 40, 80]


@pytest.mark.parametrize(("first_tick", "step"), [(0, 1), (1, 2), (5, 3), (11, 2)])
def test_every_period_of_a_drive_has_one_decision_at_any_rate_and_phase(first_tick, step):
    clock = DecisionClock(HALLWAY)
    ticks = range(first_tick, first_tick + 400, step)
    decided = [tick for tick in ticks if clock.begins(observation_at(1, 1, tick=tick))]
    assert [(tick - first_tick) // 40 for tick in decided] == list(range(10))
    assert all((tick - first_tick) % 40 < step for tick in decided)


def test_an_observation_that_comes_again_is_decided_again():
    clock = DecisionClock(HALLWAY)
    ticks = [0, 0, 1, 40, 40, 41]
    assert [clock.begins(observation_at(1, 1, tick=tick)) for tick in ticks] == [
        True, True, False, True, True, False,
    ]  # fmt: skip


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -1e300])
def test_a_waypoint_that_is_no_point_is_refused(wrong):
    for x_m, y_m in ((wrong, 1.0), (1.0, wrong)):
        with pytest.raises(SimError, match=re.escape(f"got ({x_m}, {y_m})")):
            Waypoint(x_m, y_m)
