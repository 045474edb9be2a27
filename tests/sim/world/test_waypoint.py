"""From a decision to a waypoint."""

import math
import re

import numpy as np
import pytest

from serd_core.grid.grid import Action, Grid
from serd_sim.drivers.expert_route import MOVES
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint, action_towards, waypoint_of_intent
from support.observations import observation_at

GRID = grid_of(load_scenario("hallway"))


def test_a_move_goes_straight_on_to_a_cell_a_metre_beyond_the_next_one():
    assert waypoint_of_intent(GRID, observation_at(2.2, 3.9), Action.NORTH) == Waypoint(2.5, 5.5)
    assert waypoint_of_intent(GRID, observation_at(3.2, 3.9), Action.WEST) == Waypoint(1.5, 3.5)


@pytest.mark.parametrize(("cell_size_m", "n_cells"), [(0.3, 5), (0.5, 3), (2.0, 2)])
def test_the_waypoint_is_a_metre_beyond_the_next_cell_whatever_the_size_of_cells(
    cell_size_m, n_cells
):
    grid = Grid((0.0, 0.0), cell_size_m, np.ones((1, 20), bool))
    start = observation_at(0.5 * cell_size_m, 0.5 * cell_size_m)
    ahead = waypoint_of_intent(grid, start, Action.EAST)
    assert ahead.x_m == pytest.approx((0.5 + n_cells) * cell_size_m)
    assert ahead.y_m == pytest.approx(0.5 * cell_size_m)


def test_the_waypoint_is_in_the_last_cell_before_a_wall():
    assert waypoint_of_intent(GRID, observation_at(1.2, 3.9), Action.WEST) == Waypoint(0.5, 3.5)
    assert waypoint_of_intent(GRID, observation_at(0.2, 3.9), Action.WEST) == Waypoint(0.5, 3.5)


def test_a_robot_that_is_to_wait_has_no_waypoint():
    assert waypoint_of_intent(GRID, observation_at(2.2, 3.9), Action.WAIT) is None


def test_a_robot_that_was_pushed_into_a_wall_drives_on_from_the_nearest_cell():
    pushed = observation_at(-0.1, 3.9)
    assert GRID.state_at(-0.1, 3.9) == -1
    assert waypoint_of_intent(GRID, pushed, Action.NORTH) == Waypoint(0.5, 5.5)


@pytest.mark.parametrize("action", MOVES)
def test_the_waypoint_of_an_action_lies_in_its_direction(action):
    here = observation_at(*GRID.centers_m[GRID.state_at(2.5, 4.5)])
    assert action_towards(waypoint_of_intent(GRID, here, action), here) == action


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -1e300])
def test_a_waypoint_that_is_no_point_is_refused(wrong):
    for x_m, y_m in ((wrong, 1.0), (1.0, wrong)):
        with pytest.raises(SimError, match=re.escape(f"got ({x_m}, {y_m})")):
            Waypoint(x_m, y_m)
