"""Scenarios of maps: walls near those of the map, cells that no wall divides, a task that fits."""

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from serd_app.errors import AppError
from serd_app.places.free_area import free_area_m
from serd_app.places.map_scenario import grid_scenario, map_scenario_yaml
from serd_app.places.ros_map import read_map
from serd_app.places.settings import PlaceSettings
from serd_core.grid.grid import Grid
from serd_files.yaml_config import yaml_model
from serd_sim.errors import SimError
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.occupancy import FREE, OCCUPIED, OccupancyRaster
from serd_sim.scenario.scenario import Scenario
from support import ros_maps

SMALL = PlaceSettings(robot_radius_m=0.18, max_speed_mps=0.4)


@pytest.fixture(scope="module")
def depot(tmp_path_factory):
    return read_map(ros_maps.write_map(tmp_path_factory.mktemp("d"), "depot", ros_maps.depot()))


@pytest.fixture(scope="module")
def maze(tmp_path_factory):
    return read_map(ros_maps.write_map(tmp_path_factory.mktemp("m"), "maze", ros_maps.maze()))


def scenario_of(raster, chosen=SMALL, **points):
    area = free_area_m(raster, points.get("start_m"))
    text = map_scenario_yaml(area, chosen, name="place", source="a map", **points)
    return area, yaml_model(text, Scenario, name="place")


def undivided(scenario):
    """Whether no wall as thick as a millimetre crosses a way between two cells side by side."""
    grid = grid_of(scenario)
    pairs = np.stack([np.repeat(np.arange(grid.n_states), 5), grid.neighbours.ravel()])
    ways = shapely.linestrings(grid.centers_m[pairs[:, pairs[0] < pairs[1]].T])
    holes = [each.outline_m for each in scenario.obstacles]
    free = shapely.Polygon(scenario.walkable_area_m, holes)
    return float(shapely.length(shapely.difference(ways, free)).max(initial=0.0)) < 0.001


def test_a_depot_becomes_a_scenario_whose_walls_lie_on_those_of_the_map(depot):
    """It was scanned askew, by 2 degrees."""
    area, scenario = scenario_of(depot)
    free = np.argwhere(depot.cells == FREE)
    centers_m = depot.origin_m + (free[:, ::-1] + 0.5) * depot.resolution_m
    assert shapely.contains_xy(area, centers_m).mean() > 0.98
    assert area.area == pytest.approx(len(free) * 0.05**2, rel=0.03)
    assert len(scenario.wall_segments_m) < 1000
    assert undivided(scenario)
    assert np.unique(label(scenario.cells.walkable)[0], return_counts=True)[1][1:].max() > 1000


@settings(max_examples=15)
@example(seed=47010, angle=0.0, cell_m=0.5)  # a wall between two cells that tapers to nothing
@given(seed=st.integers(0, 10**6), angle=st.floats(0.0, 1.5), cell_m=st.floats(0.3, 0.8))
def test_no_wall_divides_two_cells_whatever_the_angle_of_the_map(seed, angle, cell_m):
    rng = np.random.default_rng(seed)
    cells = np.full((80, 100), FREE, dtype=np.int8)
    for _ in range(6):
        x, y, length = rng.integers(0, 100), rng.integers(0, 80), rng.integers(10, 60)
        if rng.random() < 0.5:
            cells[y : y + 1 + rng.integers(3), x : x + length] = OCCUPIED
        else:
            cells[y : y + length, x : x + 1 + rng.integers(3)] = OCCUPIED
    raster = OccupancyRaster((3.0, -1.0), 0.05, cells, angle)
    chosen = PlaceSettings(robot_radius_m=0.12, max_speed_mps=0.5, cell_size_m=cell_m)
    try:
        _, scenario = scenario_of(raster, chosen)
    except AppError:  # no two cells are left
        return
    assert undivided(scenario)


def test_goal_and_start_are_the_cells_of_the_points_that_are_given(depot):
    points = {"goal_m": (20.0, 5.0), "start_m": (0.7, 7.5)}
    _, scenario = scenario_of(depot, **points)
    areas = scenario.goal_area_m, scenario.start_areas_m["train"]
    for corners, point in zip(areas, points.values(), strict=True):
        assert shapely.Polygon(corners).covers(shapely.Point(point))


def test_a_map_that_no_task_fits_into_gets_a_sentence(depot, maze):
    with pytest.raises(SimError, match="goal must be in a walkable cell"):
        scenario_of(depot, goal_m=(-40.0, 5.0))
    with pytest.raises(AppError, match="must lie in the free area of the map"):
        scenario_of(depot, start_m=(-40.0, 5.0))
    with pytest.raises(AppError, match="cell_size_m must leave a walkable cell"):
        scenario_of(maze, PlaceSettings(robot_radius_m=0.6))
    tiny = OccupancyRaster((0.0, 0.0), 1e-6, np.full((20, 20), FREE, dtype=np.int8))
    with pytest.raises(AppError, match="the free area must be wider than 1 mm"):
        scenario_of(tiny)


def test_a_fitted_grid_becomes_a_scenario_of_the_same_cells_unless_it_is_in_two_parts():
    walkable = np.zeros((12, 20), dtype=bool)
    walkable[1:4, 1:19], walkable[1:11, 15:18] = True, True
    grid = Grid((0.3 * 7, -0.3 * 3), 0.3, walkable[1:11, 1:19])
    goal, start = grid.state_at(6.75, 1.9), grid.state_at(2.6, -0.45)
    ends = np.array([goal]), np.array([start])
    text, scenario = grid_scenario(grid, *ends, 5.0, 0.5, name="place")
    assert yaml_model(text, Scenario, name="place") == scenario
    assert grid_of(scenario).fingerprint() == grid.fingerprint()
    assert (scenario.patience_s, scenario.wait_s) == (5.0, 0.5)
    areas = scenario.goal_area_m, scenario.start_areas_m["train"]
    for corners, state in zip(areas, (goal, start), strict=True):
        assert shapely.Polygon(corners).contains(shapely.Point(grid.centers_m[state]))
    parts = np.ones((6, 9), dtype=bool)
    parts[:, 4] = False
    two = Grid((0.0, 0.0), 0.5, parts)
    assert grid_scenario(two, np.array([0]), np.array([2]), 4.0, 1.0, name="place") is None
