"""Distance to blocked cells, where no plan of the walls is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_core.grid.grid import Grid, grid_wall_distance_m


def test_in_an_open_room_the_nearest_border_counts():
    grid = Grid((3.0, -2.0), 0.5, np.ones((5, 7), dtype=bool))
    row, column = grid.cells.T
    cells = np.minimum.reduce([row, 4 - row, column, 6 - column]) + 0.5
    np.testing.assert_allclose(grid_wall_distance_m(grid), 0.5 * cells)


def test_a_blocked_cell_counts_from_its_corner():
    walkable = np.ones((7, 7), dtype=bool)
    walkable[3, 3] = False
    distance = grid_wall_distance_m(Grid((0.0, 0.0), 1.0, walkable))
    grid = Grid((0.0, 0.0), 1.0, walkable)
    assert distance[grid.state_of_cell[2, 2]] == pytest.approx(np.hypot(0.5, 0.5))
    assert distance[grid.state_of_cell[3, 2]] == pytest.approx(0.5)
    assert distance[grid.state_of_cell[1, 3]] == pytest.approx(1.5)


@given(arrays(bool, (4, 5)).filter(lambda cells: cells.any()), st.floats(0.1, 10.0))
def test_every_cell_has_the_distance_of_a_search_over_all_blocked_cells(walkable, size_m):
    grid = Grid((0.0, 0.0), size_m, walkable)
    around = np.pad(walkable, 3)
    blocked = np.argwhere(~around) - 3
    gap = np.maximum(np.abs(grid.cells[:, None] - blocked[None]) - 0.5, 0.0)
    wanted = np.hypot(gap[..., 0], gap[..., 1]).min(axis=1) * size_m
    np.testing.assert_allclose(grid_wall_distance_m(grid), wanted)
