import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_core.errors import SerdError
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid

walkable_masks = arrays(np.bool_, st.tuples(st.integers(1, 6), st.integers(1, 6))).filter(
    lambda mask: bool(mask.any())
)


def small_grid() -> Grid:
    """Three rows of two cells, the lower right one a wall."""
    return Grid(
        origin_m=(-1.0, 2.0), cell_size_m=0.5, walkable=np.array([[1, 0], [1, 1], [1, 1]], bool)
    )


def test_states_count_walkable_cells_row_by_row_from_row_zero():
    grid = small_grid()
    assert grid.n_states == 5
    np.testing.assert_array_equal(grid.cells, [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1]])


def test_row_counts_northwards_and_column_eastwards():
    np.testing.assert_allclose(small_grid().centers_m[2], [-0.25, 2.75])


def test_neighbours_of_a_cell_beside_a_wall_stay_where_blocked():
    grid = small_grid()
    assert grid.neighbours[2, Action.SOUTH] == 2
    assert grid.neighbours[2, Action.NORTH] == 4
    assert grid.neighbours[2, Action.WEST] == 1
    assert grid.neighbours[2, Action.EAST] == 2
    assert grid.neighbours[2, Action.WAIT] == 2


@settings(deadline=None, max_examples=50)
@given(walkable_masks)
def test_a_step_and_its_opposite_come_back_unless_blocked(mask):
    grid = Grid(origin_m=(0.0, 0.0), cell_size_m=1.0, walkable=mask)
    for action, opposite in ((Action.NORTH, Action.SOUTH), (Action.EAST, Action.WEST)):
        reached = grid.neighbours[:, action]
        moved = reached != np.arange(grid.n_states)
        np.testing.assert_array_equal(
            grid.neighbours[reached[moved], opposite], np.arange(grid.n_states)[moved]
        )
        step = grid.cells[reached[moved]] - grid.cells[moved]
        assert np.all(step == DIRECTION_VECTORS[action][::-1])


@settings(deadline=None, max_examples=50)
@given(walkable_masks)
def test_the_centre_of_every_state_lies_in_that_state(mask):
    grid = Grid(origin_m=(3.0, -4.0), cell_size_m=0.7, walkable=mask)
    np.testing.assert_array_equal(grid.states_at(grid.centers_m), np.arange(grid.n_states))


def test_points_outside_in_walls_or_not_finite_have_no_state():
    grid = small_grid()
    points = [[-0.25, 2.25], [-1.1, 2.1], [0.0, 2.75], [np.nan, 2.1], [np.inf, 2.1], [1e300, 2.1]]
    np.testing.assert_array_equal(grid.states_at(points), [-1] * 6)


def test_a_cell_includes_its_lower_edge_and_not_its_upper_one():
    grid = small_grid()
    assert grid.state_at(-1.0, 2.0) == 0
    assert grid.state_at(-1.0, 2.5) == 1
    assert grid.state_at(-1.0, 3.5) == -1


def test_fingerprint_changes_with_each_part_of_the_geometry():
    base = small_grid()
    moved = Grid(origin_m=(-1.0, 2.1), cell_size_m=0.5, walkable=base.walkable)
    scaled = Grid(origin_m=(-1.0, 2.0), cell_size_m=0.6, walkable=base.walkable)
    flipped = Grid(origin_m=(-1.0, 2.0), cell_size_m=0.5, walkable=base.walkable[::-1])
    prints = {grid.fingerprint() for grid in (base, moved, scaled, flipped)}
    assert len(prints) == 4
    assert base.fingerprint() == small_grid().fingerprint()
    assert len(base.fingerprint()) == hashlib.sha256().digest_size * 2


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"cell_size_m": 0.0}, "cell_size_m must be finite and above 0, got 0.0"),
        ({"origin_m": (0.0, np.inf)}, "origin_m must be two finite numbers"),
        ({"cell_size_m": 1e300}, r"cell_size_m must be from 1e-30 to 1e.30 .* got 1e.300 and"),
        ({"origin_m": (0.0, -1e300)}, r"origin_m at most that, got 1 and \(0.0, -1e.300\)"),
        ({"walkable": np.zeros((2, 2), bool)}, "walkable must have at least one true cell"),
        ({"walkable": np.ones(3, bool)}, r"walkable must have shape \(any, any\), got \(3,\)"),
    ],
)
def test_a_wrong_geometry_is_refused_by_name(change, sentence):
    arguments = {"origin_m": (0.0, 0.0), "cell_size_m": 1.0, "walkable": np.ones((2, 2), bool)}
    with pytest.raises(SerdError, match=sentence):
        Grid(**(arguments | change))
