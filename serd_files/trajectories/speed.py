"""Whether agents of a table move as people and robots do: the test of its rate and units."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_files.trajectories.columns import Rows, TableColumns, flow_style

if TYPE_CHECKING:
    import pandas as pd

#: The lowest mean speed (m/s) that is accepted, and that above which an agent moves.
_STILL_MPS, _MOVING_MPS = 0.005, 0.2
#: Speeds are those of ways over so many seconds, so that noise of single places does not count.
_OVER_S = 1.0
#: Fewest moving ways by which a table is judged.
_FEWEST = 10
#: The usual speed of walking (m/s), by which a likely rate is found, and rates of cameras.
_WALKING_MPS = 1.34
_USUAL_FPS = np.array([1, 2, 2.5, 5, 6, 7.5, 8, 10, 12, 12.5, 15, 16, 20, 24, 25, 30, 50, 60, 100])


def of_speed(path: Path, rows: Rows, points: "pd.DataFrame", wanted: TableColumns) -> list[str]:
    """Return sentences about assumed units; FileError for speeds that no person or robot has."""
    speeds_mps = _speeds_mps(points)
    moving = speeds_mps[speeds_mps > _MOVING_MPS]
    if 0 < len(moving) < _FEWEST:
        mean_mps = min(float(moving.mean()), wanted.fastest_mps)
    else:
        mean_mps = float(moving.mean()) if len(moving) else float(speeds_mps.mean())
    if len(speeds_mps) > 1 and mean_mps == 0.0:
        raise FileError(
            f"{path}: agents must move, but no place changes; name the columns of places in a"
            " --mapping file (x: and y:)"
        )
    if 0 < mean_mps < _STILL_MPS:
        raise FileError(
            f"{path}: agents must move, but their mean speed is {mean_mps:.2g} m/s;"
            " state unit: and time_unit: or fps: in a --mapping file; degrees are no unit of places"
        )
    if mean_mps > wanted.fastest_mps:
        raise FileError(
            f"{path}: moving agents must have a mean speed of at most {wanted.fastest_mps:g} m/s,"
            f" it is {mean_mps:.3g} m/s; {_suspect(rows, mean_mps, wanted)}; where all is"
            f" right, state {flow_style({'fastest_mps': float(f'{1.2 * mean_mps:.2g}')})}"
        )
    units = rows.assumed
    if not units:
        return []
    keys = " and ".join(f"'{key}:'" for key in units)
    return [
        f"{' and '.join(units.values())} are assumed (then agents move at {mean_mps:.2g} m/s);"
        f" {keys} in a --mapping file {'state' if len(units) > 1 else 'states'} others"
    ]


def _speeds_mps(points: "pd.DataFrame") -> FloatArray:
    """Return the speeds of all agents over about a second, or over one step that is longer."""
    found = [np.zeros(1)]
    for _, piece in points.groupby(["agent", "part"]):
        time_s, place_m = piece.time_s.to_numpy(), piece[["x", "y"]].to_numpy()
        later = np.searchsorted(time_s, time_s + _OVER_S - 1e-9)
        rows = np.flatnonzero(later < len(time_s))
        if not len(rows) and len(time_s) > 1:  # a shorter track
            rows, later = np.zeros(1, dtype=np.int64), np.full(len(time_s), len(time_s) - 1)
        step_s = time_s[later[rows]] - time_s[rows]
        moved_m = np.hypot(*(place_m[later[rows]] - place_m[rows]).T)
        found.append(moved_m[step_s > 0] / step_s[step_s > 0])
    return np.concatenate(found)


def _suspect(rows: Rows, mean_mps: float, wanted: TableColumns) -> str:
    """Return the first thing that is to be corrected, with the mapping that does so."""
    if wanted.fps is not None:
        fitting = _USUAL_FPS[np.abs(_USUAL_FPS * mean_mps / wanted.fps - _WALKING_MPS).argmin()]
        rate = f"at {fitting:g} frames per second it is {mean_mps * fitting / wanted.fps:.2f} m/s"
        if fitting < wanted.fps and mean_mps * fitting / wanted.fps <= wanted.fastest_mps:
            return (
                f"the rate of {wanted.fps:g} frames per second is the first suspect: {rate}, stated"
                f" by {flow_style({'fps': float(fitting)})} in a --mapping file"
            )
    for unit, factor in (("cm", 0.01), ("mm", 0.001)):
        if _MOVING_MPS < mean_mps * factor <= wanted.fastest_mps and wanted.unit is None:
            return (
                f"in {unit} it is {mean_mps * factor:.2f} m/s, stated by"
                f" {flow_style({'unit': unit})} in a --mapping file"
            )
    ids = "" if rows.has_ids else ", or the column of ids by agent:"
    return f"state fps: or time_unit: and unit: in a --mapping file{ids}"
