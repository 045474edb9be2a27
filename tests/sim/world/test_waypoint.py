"""From a decision to a waypoint, and what a world commands of a commander that fails."""

import math

import numpy as np
import pytest

from serd_core.grid.grid import Action, Grid
from serd_sim.drivers.catalogue import MOVES
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command, CommandGuard
from serd_sim.world.waypoint import Waypoint, action_towards, waypoint_of_intent
from support.observations import observation_at

GRID = grid_of(load_scenario("hallway"))


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
    assert waypoint_of_intent(GRID, observation_at(*place), action) == expected


@pytest.mark.parametrize(("cell_size_m", "n_cells"), [(0.3, 5), (0.5, 3), (2.0, 2)])
def test_the_waypoint_is_a_metre_beyond_the_next_cell_whatever_the_size_of_cells(
    cell_size_m, n_cells
):
    grid = Grid((0.0, 0.0), cell_size_m, np.ones((1, 20), bool))
    start = observation_at(0.5 * cell_size_m, 0.5 * cell_size_m)
    ahead = waypoint_of_intent(grid, start, Action.EAST)
    expected = (0.5 + n_cells) * cell_size_m, 0.5 * cell_size_m
    assert (ahead.x_m, ahead.y_m) == pytest.approx(expected)


@pytest.mark.parametrize("action", MOVES)
def test_the_waypoint_of_an_action_lies_in_its_direction(action):
    here = observation_at(2.5, 4.5)
    assert action_towards(waypoint_of_intent(GRID, here, action), here) == action


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
