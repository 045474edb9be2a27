from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.demonstrations.crossings import CellTracker
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid

GRID = Grid((0.0, 0.0), 1.0, np.ones((3, 6), bool))


def state(column, row):
    return int(GRID.state_of_cell[row, column])


def cell_crossings(grid, time_s, position_m, hysteresis_m=0.0):
    tracker, entered = CellTracker(grid, hysteresis_m), []
    for at_s, (x_m, y_m) in zip(time_s, position_m, strict=True):
        entered += tracker.see(at_s, x_m, y_m)
    return SimpleNamespace(
        state=np.array([each.state for each in entered], dtype=int),
        entered_s=np.array([each.time_s for each in entered]),
    )


def test_a_way_goes_through_each_cell_in_the_order_of_the_borders_that_it_passes():
    found = cell_crossings(GRID, np.array([0.0, 4.0]), np.array([[0.5, 1.5], [4.5, 1.5]]))
    assert found.state.tolist() == [state(column, 1) for column in range(5)]
    np.testing.assert_allclose(found.entered_s, [0.0, 0.5, 1.5, 2.5, 3.5])
    found = cell_crossings(GRID, np.array([0.0, 1.0]), np.array([[0.5, 0.6], [1.5, 1.6]]))
    assert found.state.tolist() == [state(0, 0), state(0, 1), state(1, 1)]
    np.testing.assert_allclose(found.entered_s, [0.0, 0.4, 0.5])


def test_swaying_within_the_hysteresis_crosses_nothing():
    time = np.arange(100) * 0.1
    sway = np.stack([0.5 + 0.05 * time, 1.0 + 0.08 * np.sin(5 * time)], axis=1)
    assert len(cell_crossings(GRID, time, sway).state) > 4
    assert len(cell_crossings(GRID, time, sway, hysteresis_m=0.1).state) == 1


@pytest.mark.parametrize("turned", [False, True])
def test_places_beyond_a_wall_of_any_side_stay_in_the_cell(turned):
    places = np.array([[4.5, 2.5], [4.6, 3.2], [5.5, 2.6], [6.2, 2.6], [5.6, 1.9]])
    grid = Grid(GRID.origin_m, 1.0, GRID.walkable.T) if turned else GRID
    found = cell_crossings(grid, np.arange(5.0), places[:, ::-1] if turned else places)
    cells = grid.cells[found.state]
    assert (cells if turned else cells[:, ::-1]).tolist() == [[4, 2], [5, 2], [5, 1]]


def test_a_cell_that_no_way_of_the_grid_leads_to_is_entered_where_it_is_seen():
    pillar = np.ones((3, 6), bool)
    pillar[1, 2] = False
    grid = Grid((0.0, 0.0), 1.0, pillar)
    time, x_m = np.arange(9) * 0.5, np.linspace(0.5, 4.5, 9)
    found = cell_crossings(grid, time, np.stack([x_m, np.full(9, 1.9)], axis=1), 0.1)
    assert [grid.cells[each].tolist() for each in found.state] == [[1, 0], [1, 1], [1, 3], [1, 4]]
    np.testing.assert_allclose(found.entered_s, [0.0, 0.6, 2.5, 3.6])


def test_a_tracker_takes_positions_one_by_one_and_begins_anew_after_a_reset():
    tracker = CellTracker(GRID, 0.1)
    assert tracker.see(0.0, 9.0, 9.0) == ()
    assert tracker.see(1.0, np.nan, 0.5) == ()
    assert list(tracker.see(2.0, 0.5, 0.5)) == [(2.0, state(0, 0))]
    assert list(tracker.see(3.0, 1.05, 0.5)) == []
    assert list(tracker.see(4.0, 2.05, 0.5)) == [(pytest.approx(3.05), state(1, 0))]
    tracker.reset()
    assert tracker.state == -1
    assert list(tracker.see(4.0, 5.5, 2.5)) == [(4.0, state(5, 2))]


@settings(deadline=None, max_examples=60)
@given(
    steps=st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=12),
    hysteresis=st.sampled_from([0.0, 0.1, 0.3]),
)
def test_each_move_leads_to_a_neighbour_and_times_do_not_decrease(steps, hysteresis):
    places = np.cumsum(np.array([(2.5, 1.5), *steps]), axis=0)
    found = cell_crossings(GRID, np.arange(len(places)) * 0.4, places, hysteresis)
    moved = np.abs(np.diff(GRID.cells[found.state], axis=0)).sum(axis=1)
    assert np.all(moved == 1)
    assert np.all(np.diff(found.entered_s) >= 0)


def test_a_hysteresis_of_half_a_cell_is_rejected():
    with pytest.raises(SerdError, match=r"hysteresis_m must be at least 0 and below half a cell"):
        CellTracker(GRID, 0.5)
