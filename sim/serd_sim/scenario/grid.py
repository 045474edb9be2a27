"""A scenario on the coarse grid: cells, flow, goal, starts, walls, and its decision problem."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from serd_bag.nearest import choice_rule
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid
from serd_core.grid.navigation import NO_FLOW, NavigationProblem, build_navigation_problem
from serd_sim.errors import SimError
from serd_sim.scenario.polygon import (
    Point,
    contains,
    contains_point,
    distance_to_segments_m,
    edges_of,
)
from serd_sim.scenario.rules import has_room
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import Loop

Area = tuple[Point, ...]
_WEAKEST_FLOW = 0.05


def flow_vectors(loops: tuple[Loop, ...], points_m: FloatArray, cell_size_m: float) -> FloatArray:
    """(N, 2) walking directions around each point, weighted by share and nearness.

    f = sum over legs of share * max(0, 1 - (d / h)^2) * direction, with d the distance to the leg
    and h its reach: the half width of the lane plus three quarters of a cell.
    """
    total = np.zeros((len(points_m), 2))
    for loop in loops:
        legs = edges_of(loop.waypoints_m)
        along = legs[:, 1] - legs[:, 0]
        direction = along / np.linalg.norm(along, axis=1, keepdims=True)
        reach = loop.lane_half_width_m + 0.75 * cell_size_m
        nearness = 1.0 - (distance_to_segments_m(points_m, legs) / reach) ** 2
        total += loop.share * np.maximum(nearness, 0.0) @ direction
    return total


def grid_of(scenario: Scenario) -> Grid:
    """Grid over the scenario's bounds, of the cells that the robot fits into."""
    return scenario.cells.grid


def flow_of(scenario: Scenario, grid: Grid) -> IntArray:
    """(S,) direction people walk in each cell as an `Action`, -1 for none."""
    loops = scenario.pedestrians.loops if scenario.pedestrians.count else ()
    vectors = flow_vectors(loops, grid.centers_m, grid.cell_size_m)
    direction = np.argmax(vectors @ DIRECTION_VECTORS[1:].T, axis=1) + int(Action.NORTH)
    strong = np.linalg.norm(vectors, axis=1) > _WEAKEST_FLOW
    return np.where(strong, direction, NO_FLOW).astype(np.int64)


def goal_states_of(scenario: Scenario, grid: Grid) -> IntArray:
    """States whose centre lies in the goal area."""
    return np.flatnonzero(contains(scenario.goal_area_m, grid.centers_m))


def is_at_goal(scenario: Scenario, goal_area_m: Area, x_m: float, y_m: float) -> bool:
    """Whether a point, or the centre of its cell, is in a goal area."""
    if contains_point(goal_area_m, x_m, y_m):
        return True
    grid = scenario.cells.grid
    state = grid.state_at(x_m, y_m)
    return state >= 0 and contains_point(goal_area_m, *grid.centers_m[state])


def start_states_of(scenario: Scenario, grid: Grid, area: str) -> IntArray:
    """States in which a robot starts: in the start area of that name, with room between walls.

    Where there are only narrow ones, all of that area.
    """
    if area not in scenario.start_areas_m:
        raise SimError(choice_rule("start area", area, sorted(scenario.start_areas_m)))
    states = np.flatnonzero(contains(scenario.start_areas_m[area], grid.centers_m))
    walls_m, radius_m = scenario.wall_segments_m, scenario.robot.radius_m
    roomy = has_room(grid.centers_m[states], grid.cell_size_m, walls_m, radius_m)
    return states[roomy] if roomy.any() else states


def wall_distance_of(scenario: Scenario, grid: Grid) -> FloatArray:
    """(S,) metres to the nearest wall, from each cell's centre or the middle of its free part."""
    cells = scenario.cells
    places_m = cells.middles_m if grid is cells.grid else grid.centers_m
    distance = distance_to_segments_m(places_m, scenario.wall_segments_m)
    return np.asarray(distance.min(axis=1))


def navigation_problem_of(
    scenario: Scenario,
    discount: float,
    features: Sequence[str] | None = None,
    flow: IntArray | None = None,
    own_features: Mapping[str, FloatArray] = MappingProxyType({}),
) -> NavigationProblem:
    """The decision problem of section 5.1 on this scenario's grid.

    features: by default all that the place has; own_features: (S,) of each further one. flow: (S,)
    as recorded, in place of the one that the scenario's loops make.
    """
    grid = grid_of(scenario)
    return build_navigation_problem(
        grid=grid,
        flow=flow_of(scenario, grid) if flow is None else flow,
        goal_states=goal_states_of(scenario, grid),
        wall_distance_m=wall_distance_of(scenario, grid),
        discount=discount,
        features=features,
        own_features=own_features,
    )


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
