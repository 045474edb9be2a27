import hashlib
import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from serd_core.grid.grid import (
    DIRECTION_VECTORS,
    Action,
    Grid,
    action_of_direction,
    direction_of_action,
    grid_wall_distance_m,
)
from support.refusals import refusals

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


def test_points_outside_in_walls_or_not_finite_have_no_state():
    grid = small_grid()
    points = [[-0.25, 2.25], [-1.1, 2.1], [0.0, 2.75], [np.nan, 2.1], [np.inf, 2.1], [1e300, 2.1]]
    np.testing.assert_array_equal(grid.states_at(points), [-1] * 6)
    # A cell includes its lower edge and not its upper one.
    assert grid.state_at(-1.0, 2.0) == 0
    assert grid.state_at(-1.0, 2.5) == 1
    assert grid.state_at(-1.0, 3.5) == -1


def test_neighbours_of_a_cell_beside_a_wall_stay_where_blocked():
    grid = small_grid()
    np.testing.assert_array_equal(grid.neighbours[2], [2, 4, 2, 2, 1])
    np.testing.assert_allclose(grid.centers_m[2], [-0.25, 2.75])


def test_fingerprint_changes_with_each_part_of_the_geometry():
    given = (-1.0, 2.0), 0.5, small_grid().walkable
    changes = {0: (-1.0, 2.1), 1: 0.6, 2: given[2][::-1]}
    grids = [Grid(*(changes[k] if k == j else x for k, x in enumerate(given))) for j in range(4)]
    assert len({grid.fingerprint() for grid in grids}) == 4
    assert grids[3].fingerprint() == small_grid().fingerprint()
    assert len(grids[3].fingerprint()) == hashlib.sha256().digest_size * 2


@given(arrays(bool, (4, 5)).filter(lambda cells: cells.any()), st.floats(0.1, 10.0))
def test_every_cell_has_the_distance_of_a_search_over_all_blocked_cells(walkable, size_m):
    grid = Grid((3.0, -2.0), size_m, walkable)
    blocked = np.argwhere(~np.pad(walkable, 3)) - 3
    gap = np.maximum(np.abs(grid.cells[:, None] - blocked[None]) - 0.5, 0.0)
    wanted = np.hypot(gap[..., 0], gap[..., 1]).min(axis=1) * size_m
    np.testing.assert_allclose(grid_wall_distance_m(grid), wanted)


@given(angle=st.floats(-math.pi, math.pi), length=st.floats(0.51, 10.0))
def test_a_direction_means_an_axis_at_most_45_degrees_away(angle, length):
    east, north = length * math.cos(angle), length * math.sin(angle)
    axis = direction_of_action(action_of_direction(east, north))
    assert axis[0] * east + axis[1] * north >= length * math.cos(math.pi / 4) - 1e-9
    assert action_of_direction(0.3, -0.3) == Action.WAIT
    assert all(action_of_direction(*direction_of_action(action)) == action for action in Action)


CELLS = np.ones((2, 2), bool)


test_a_wrong_geometry_is_refused_by_name = refusals(
    (lambda: Grid((0, 0), 0.0, CELLS), "cell_size_m must be finite and above 0, got 0.0"),
    (lambda: Grid((0.0, np.inf), 1.0, CELLS), "origin_m must be two finite numbers"),
    (lambda: Grid((0, 0), 1e300, CELLS), r"cell_size_m must be from 1e-30 to 1e.30 .* 1e.300"),
    (lambda: Grid((0, -1e300), 1.0, CELLS), r"origin_m at most that, got 1 and \(0.0, -1e"),
    (lambda: Grid((0, 0), 1.0, ~CELLS), "walkable must have at least one true cell, got none"),
    (lambda: Grid((0, 0), 1.0, np.ones(3, bool)), r"walkable must have shape \(any, any\), go"),
    (lambda: action_of_direction(math.nan, 0.0), r"send \(0, 0\) to wait"),
)
