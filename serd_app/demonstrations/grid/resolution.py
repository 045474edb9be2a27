"""Cells and patience for recordings of a place that is not known, by how fast the robot drives."""

from collections.abc import Sequence

import numpy as np

from serd_app.drives.recorded_drive import RecordedDrive
from serd_core.arrays import FloatArray
from serd_sim.scenario.scenario import Scenario

USUAL_PATIENCE_S: float = Scenario.model_fields["patience_s"].default
USUAL_WAIT_S: float = Scenario.model_fields["wait_s"].default
_CELLS_M = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0)
_USUAL_CELL_M = 0.5
_SECOND_S = 1.0
#: The patience is at least so many times the time for a cell at the usual speed.
_PATIENT_CELLS = 3.0


def fitting_cell_size_m(drives: Sequence[RecordedDrive]) -> float:
    """The size that is nearest to the way of a second, as the robot drives while it moves; 0.5 m
    where it never moves."""
    speed_mps = _usual_speed_mps(drives)
    return cell_size_at_m(speed_mps) if speed_mps else _USUAL_CELL_M


def cell_size_at_m(speed_mps: float) -> float:
    """The size that is nearest to the way of a second at a speed."""
    way_m = speed_mps * _SECOND_S
    return min(_CELLS_M, key=lambda size_m: abs(np.log(size_m / way_m)))


def fitting_patience_s(drives: Sequence[RecordedDrive], cell_size_m: float) -> float:
    """The usual one, or one with which the robot crosses cells of this size as it drives."""
    speed_mps = _usual_speed_mps(drives)
    if not speed_mps:
        return USUAL_PATIENCE_S
    return max(USUAL_PATIENCE_S, float(np.ceil(_PATIENT_CELLS * cell_size_m / speed_mps)))


def _usual_speed_mps(drives: Sequence[RecordedDrive]) -> float:
    """The median while it moves; 0 where it never does."""
    speeds_mps = np.concatenate([np.zeros(0), *map(_speeds_mps, drives)])
    return float(np.median(speeds_mps)) if len(speeds_mps) else 0.0


def _speeds_mps(drive: RecordedDrive) -> FloatArray:
    """(N,) of the seconds of its episodes in which it moves."""
    found = [np.zeros(0)]
    for span in drive.episodes:
        if span.demonstrates:
            time_s = np.arange(span.start_s, span.end_s + 1e-6, _SECOND_S)
            columns = [np.interp(time_s, drive.pose_time_s, each) for each in drive.position_m.T]
            found.append(np.hypot(*np.diff(columns)) / _SECOND_S)
    speeds_mps = np.concatenate(found)
    return np.asarray(speeds_mps[speeds_mps >= max(drive.minimum_speed_mps, 1e-3)])
