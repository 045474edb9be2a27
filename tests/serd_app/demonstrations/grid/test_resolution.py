"""Advice on cells and periods against closed forms of straight drives and turns."""

import numpy as np
import pytest

from serd_app.demonstrations.grid.resolution import MOST_FAR, fitting_cell_size_m, resolution_advice
from serd_app.drives.episode_spans import RETURN, EpisodeSpan
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.report.figures.charts import draw_resolution
from serd_app.report.style import png_bytes


def drive(position_m, step_s=0.05, outcome="arrived"):
    position_m = np.asarray(position_m, dtype=float)
    time_s = step_s * np.arange(len(position_m))
    spans = (EpisodeSpan(0, 0.0, float(time_s[-1]), outcome),)
    nothing = np.zeros(0)
    return RecordedDrive(time_s, position_m, nothing, nothing.astype(np.int64), spans)


def straight(speed_mps, seconds=200.0, y_m=0.33):
    x_m = speed_mps * np.arange(0.0, seconds, 0.05)
    return drive(np.column_stack([x_m, np.full(len(x_m), y_m)]))


def test_a_robot_that_drives_a_cell_per_period_completes_every_move():
    advice = resolution_advice([straight(0.5001)], 0.5, 1.0)
    assert advice.used.completed > 0.99
    assert advice.best.completed > 0.94
    assert (advice.speed_mps, advice.turning) == (pytest.approx(0.5001), 0.0)
    assert not advice.too_fine


@pytest.mark.parametrize(("speed", "period_s", "size_m"), [(0.4999, 1.0, 0.5), (0.12, 2.0, 0.25)])
def test_cells_that_fit_are_about_what_the_robot_drives_in_a_period(speed, period_s, size_m):
    assert fitting_cell_size_m([straight(speed)], period_s) == size_m


def test_for_a_robot_that_stands_cells_are_half_a_metre():
    assert fitting_cell_size_m([straight(0.0)], 1.0) == 0.5


@pytest.mark.parametrize("speed", [0.2 * 2**0.5, 0.3 * 3**0.5, 0.8 * 1.618034])
@pytest.mark.parametrize("cell", [0.3, 0.5, 1.0])
def test_a_straight_drive_stays_in_the_share_of_periods_that_the_cell_size_gives(speed, cell):
    used = resolution_advice([straight(speed, 800.0)], cell, 1.0).used
    ways = speed / cell  # cells per period: the far share is what is over 1
    assert used.stayed == pytest.approx(max(0.0, 1.0 - ways), abs=0.05)
    assert used.far == pytest.approx(min(1.0, max(0.0, ways - 1.0)), abs=0.05)
    assert used.stayed + used.completed + used.diagonal + used.far == pytest.approx(1.0)


@pytest.mark.parametrize(("origin_m", "completed"), [((0.0, 0.0), 0.0), ((0.25, 0.0), 1.0)])
def test_cells_begin_at_the_origin_of_the_grid(origin_m, completed):
    # To and fro between 0.1 and 0.4 m: across the line x = 0.25 m only.
    x_m = 0.25 - 0.15 * np.cos(np.pi * np.arange(0.0, 40.0, 0.05))
    there_and_back = drive(np.column_stack([x_m, np.full(len(x_m), 0.2)]))
    used = resolution_advice([there_and_back], 0.5, 1.0, origin_m=origin_m).used
    assert (used.completed, used.stayed) == (completed, 1.0 - completed)


def test_cells_that_are_jumped_over_are_warned_of_and_others_advised():
    advice = resolution_advice([straight(0.4)], 0.2, 2.0)
    assert advice.too_fine
    assert advice.best.far <= MOST_FAR
    *_, last = advice.sentences()
    assert "fit better" in last
    assert png_bytes(draw_resolution(advice)).startswith(b"\x89PNG")


def test_turns_of_a_circle_are_counted():
    angle = 0.8 * np.arange(0.0, 100.0, 0.05)  # rad: between halves of 2 s the course turns by 0.8
    circle = 2.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert resolution_advice([drive(circle)], 1.0, 2.0).turning == 1.0
    assert resolution_advice([drive(circle)], 1.0, 1.0).turning == 0.0


def test_ways_back_and_standing_robots_give_no_advice():
    still = drive(np.zeros((400, 2)))
    back = drive(straight(0.5).position_m, outcome=RETURN)
    assert resolution_advice([still, back], 0.5, 1.0) is None
