"""Grids around positions, and cells and patience against closed forms of straight drives."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_app.demonstrations.fitted_grid import (
    USUAL_PATIENCE_S,
    fitting_cell_size_m,
    fitting_patience_s,
    grid_around,
)
from serd_app.drives.drive import RETURN, EpisodeSpan, RecordedDrive
from serd_bag.errors import BagError

number = st.floats(-10, 10)


@given(st.lists(st.tuples(number, number), min_size=1, max_size=20))
def test_a_fitted_grid_holds_every_position(places):
    assert (grid_around(np.array(places), 0.5).states_at(places) >= 0).all()


@pytest.mark.parametrize("far_m", [3e4, 1e6, 1e300, -1.7e308])
def test_a_pose_far_from_the_others_is_named_and_no_grid_fitted(far_m):
    places = np.array([[1.0, 2.0], [1.5, 2.0], [far_m, -far_m], [2.0, 2.0]])
    farthest = re.escape(f"the pose ({far_m:g}, {-far_m:g}) m lies")
    with pytest.raises(BagError, match=f"must have at most 4000000 cells, .* {farthest}"):
        grid_around(places, 0.5)


def straight(speed_mps, seconds=200.0, outcome="arrived"):
    time_s = np.arange(0.0, seconds, 0.05)
    position_m = np.column_stack([speed_mps * time_s, np.full(len(time_s), 0.33)])
    spans = (EpisodeSpan(0, 0.0, float(time_s[-1]), outcome),)
    return RecordedDrive(time_s, position_m, np.zeros(0), np.zeros(0, dtype=np.int64), spans)


@pytest.mark.parametrize(
    ("drives", "size_m"),
    [
        *(([straight(speed_mps)], size_m) for speed_mps, size_m in
          ((0.5, 0.5), (0.12, 0.1), (1.3, 1.25), (9.0, 5))),
        ([straight(0.5), straight(0.0, 300.0)], 0.5),
        ([straight(0.2, outcome=RETURN)], 0.5),
        ([straight(0.0)], 0.5),
    ],
)  # fmt: skip
def test_cells_are_about_what_the_robot_drives_in_a_second_while_it_moves(drives, size_m):
    assert fitting_cell_size_m(drives) == size_m


@pytest.mark.parametrize(
    ("drive", "cell_m", "patience_s"),
    [
        (straight(0.5), 0.5, USUAL_PATIENCE_S),
        (straight(0.5), 2.1, 13.0),
        (straight(0.0), 5.0, USUAL_PATIENCE_S),
        (straight(0.2, outcome=RETURN), 5.0, USUAL_PATIENCE_S),
    ],
)
def test_the_patience_is_enough_for_large_cells(drive, cell_m, patience_s):
    assert fitting_patience_s([drive], cell_m) == patience_s
