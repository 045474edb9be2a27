"""Any walkable cell as the goal of a scenario."""

import math

import numpy as np

from serd_core.grid.grid import Grid
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.polygon import Point
from serd_sim.scenario.scenario import Scenario

Area = tuple[Point, ...]


def goal_at(scenario: Scenario, x_m: float, y_m: float) -> Scenario:
    """The same scenario with the cell under a point as its goal area.

    SimError with the nearest walkable cell for a point that is in none.
    """
    grid = grid_of(scenario)
    area = cell_area_m(grid, goal_cell(grid, x_m, y_m))
    return scenario.model_copy(update={"goal_area_m": area})


def with_goal(scenario: Scenario, text: str) -> Scenario:
    """The scenario with the goal at "x, y" (m), unchanged for empty text; SimError if malformed."""
    return goal_at(scenario, *point_of(text)) if text.strip() else scenario


def point_of(text: str, *, what: str = "goal") -> Point:
    """The point "x, y" names; SimError if it names none. what: the point, for errors."""
    try:
        x_m, y_m = (float(part) for part in text.split(","))
    except ValueError:
        raise SimError(
            f"{what} must be two numbers 'x, y' (m), got {text!r}; try '3.5, 20.5'"
        ) from None
    return x_m, y_m


def goal_cell(grid: Grid, x_m: float, y_m: float, *, what: str = "goal") -> int:
    """State under the point; SimError where there is none. what: the point, for errors."""
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        raise SimError(f"{what} must be two finite numbers (m), got ({x_m}, {y_m}); set a point")
    state = grid.state_at(x_m, y_m)
    if state < 0:
        away_m = np.hypot(grid.centers_m[:, 0] - x_m, grid.centers_m[:, 1] - y_m)
        near_x_m, near_y_m = grid.centers_m[int(np.argmin(away_m))]
        raise SimError(
            f"{what} must be in a walkable cell, got ({x_m:g}, {y_m:g}) m"
            f"; the nearest one is at ({near_x_m:g}, {near_y_m:g})"
        )
    return state


def cell_area_m(grid: Grid, state: int) -> Area:
    """Corners of a state's cell, counter-clockwise; in single precision, as messages carry them."""
    low_m, high_m = grid.centers_m[state] + 0.5 * grid.cell_size_m * np.array([[-1.0], [1.0]])
    west, south = (float(value) for value in low_m.astype(np.float32))
    east, north = (float(value) for value in high_m.astype(np.float32))
    return ((west, south), (east, south), (east, north), (west, north))
