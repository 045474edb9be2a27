"""What a scenario is on the coarse grid: walkable cells, flow, goal, starts, distance to walls."""

from collections.abc import Sequence

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Grid
from serd_core.grid.navigation import FEATURE_NAMES, NavigationProblem, build_navigation_problem
from sim.errors import SimError
from sim.geometry.polygon import contains, distance_to_segments_m
from sim.scenario.flow_field import flow_vectors, quantised_flow
from sim.scenario.rules import has_room
from sim.scenario.scenario import Scenario
from storage.nearest import nearest_name


def grid_of(scenario: Scenario) -> Grid:
    """Grid over the scenario's bounds; a cell is walkable when its centre is."""
    cells = scenario.cells
    return Grid(cells.origin_m, cells.cell_size_m, cells.walkable)


def flow_of(scenario: Scenario, grid: Grid) -> IntArray:
    """(S,) direction people walk in each cell as an `Action`, -1 for none."""
    loops = scenario.directed_loops if scenario.pedestrians.count else ()
    return quantised_flow(flow_vectors(loops, grid.centers_m, grid.cell_size_m))


def goal_states_of(scenario: Scenario, grid: Grid) -> IntArray:
    """States whose centre lies in the goal area."""
    return np.flatnonzero(contains(scenario.goal_area_m, grid.centers_m))


def start_states_of(scenario: Scenario, grid: Grid, area: str) -> IntArray:
    """States in which a robot starts: in the start area of that name, with room between walls."""
    if area not in scenario.start_areas_m:
        known = sorted(scenario.start_areas_m)
        meant = nearest_name(area, known) or known[0]
        raise SimError(
            f"start area must be one of {', '.join(known)}, got {area!r}; did you mean {meant!r}?"
        )
    states = np.flatnonzero(contains(scenario.start_areas_m[area], grid.centers_m))
    walls_m, radius_m = scenario.wall_segments_m, scenario.robot.radius_m
    return states[has_room(grid.centers_m[states], grid.cell_size_m, walls_m, radius_m)]


def wall_distance_of(scenario: Scenario, grid: Grid) -> FloatArray:
    """(S,) metres from each cell's centre to the nearest wall."""
    distance = distance_to_segments_m(grid.centers_m, scenario.wall_segments_m)
    return np.asarray(distance.min(axis=1))


def navigation_problem_of(
    scenario: Scenario,
    discount: float,
    features: Sequence[str] = FEATURE_NAMES,
    flow: IntArray | None = None,
) -> NavigationProblem:
    """The decision problem of section 5.1 on this scenario's grid.

    flow: (S,) as recorded, in place of the one that the scenario's loops make.
    """
    grid = grid_of(scenario)
    return build_navigation_problem(
        grid=grid,
        flow=flow_of(scenario, grid) if flow is None else flow,
        goal_states=goal_states_of(scenario, grid),
        wall_distance_m=wall_distance_of(scenario, grid),
        discount=discount,
        features=features,
    )
