"""Cells and patience against closed forms of straight drives."""

import numpy as np
import pytest

from serd_app.demonstrations.grid.fitted_grid import (
    USUAL_PATIENCE_S,
    fitting_cell_size_m,
    fitting_patience_s,
)
from serd_app.drives.episode_spans import RETURN, EpisodeSpan
from serd_app.drives.recorded_drive import RecordedDrive


def straight(speed_mps, seconds=200.0, outcome="arrived"):
    time_s = np.arange(0.0, seconds, 0.05)
    position_m = np.column_stack([speed_mps * time_s, np.full(len(time_s), 0.33)])
    spans = (EpisodeSpan(0, 0.0, float(time_s[-1]), outcome),)
    nothing = np.zeros(0)
    return RecordedDrive(time_s, position_m, nothing, nothing.astype(np.int64), spans)


@pytest.mark.parametrize(("speed_mps", "size_m"), [(0.5, 0.5), (0.12, 0.1), (1.3, 1.25), (9.0, 5)])
def test_cells_are_about_what_the_robot_drives_in_a_second(speed_mps, size_m):
    assert fitting_cell_size_m([straight(speed_mps)]) == size_m


def test_a_robot_that_stands_half_of_the_time_is_as_fast_as_while_it_moves():
    assert fitting_cell_size_m([straight(0.5), straight(0.0, 300.0)]) == 0.5


@pytest.mark.parametrize("drive", [straight(0.0), straight(0.2, outcome=RETURN)])
def test_for_a_robot_that_stands_or_is_on_its_way_back_cells_are_half_a_metre(drive):
    assert fitting_cell_size_m([drive]) == 0.5
    assert fitting_patience_s([drive], 5.0) == USUAL_PATIENCE_S


def test_the_patience_is_enough_for_large_cells():
    assert fitting_patience_s([straight(0.5)], 0.5) == USUAL_PATIENCE_S
    assert fitting_patience_s([straight(0.5)], 2.1) == 13.0
