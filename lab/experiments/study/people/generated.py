"""Corridors of known geometry with people of the simulated crowd, as tables of trajectories.

The crowd walks both ways through a ring; the way of a person through a window of it is a person of
the table. Ids, times in s and places in m are as a recording has them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from lab.crowd.ring_corridor import ring_corridor_crowd
from serd_bag.files import atomic_write_text
from serd_core.arrays import FloatArray

_RING_M, _WINDOW_M, _STEP_S, _EVERY, _SETTLED_S = 24.0, 10.0, 0.05, 2, 10.0


@dataclass(frozen=True)
class Corridor:
    """A corridor at an angle to x, with people per square metre."""

    width_m: float
    angle_deg: float
    density_pm2: float

    def placed(self, along_across_m: FloatArray) -> FloatArray:
        """(N, 2) places of the table of (N, 2) places along and across the corridor."""
        angle = np.deg2rad(self.angle_deg)
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return np.asarray(along_across_m @ axes + 5.0)


CORRIDORS = {
    "narrow": Corridor(3.0, 90.0, 0.6),
    "wide": Corridor(3.6, 90.0, 1.0),
    "askew": Corridor(4.0, 25.0, 0.8),
}


def write_corridor(name: str, folder: Path, duration_s: float = 180.0, seed: int = 1) -> Path:
    """Simulate a corridor; writes NAME.csv and its walkable area NAME.wkt, returns the table."""
    chosen = CORRIDORS[name]
    crowd = ring_corridor_crowd(
        width_m=chosen.width_m, length_m=_RING_M, density_pm2=chosen.density_pm2,
        share_backwards=0.5, rng=np.random.default_rng(seed),
    )  # fmt: skip
    rows, passed = list[str](), np.zeros(len(crowd), dtype=np.int64)
    inside = np.zeros(len(crowd), dtype=bool)
    for step in range(round(duration_s / _STEP_S)):
        crowd.step(_STEP_S)
        now = crowd.x_m < _WINDOW_M
        passed += now & ~inside
        inside, time_s = now, step * _STEP_S
        if step % _EVERY == 0 and time_s >= _SETTLED_S:
            ids = np.arange(len(crowd)) + len(crowd) * passed
            rows += [
                f"{who},{time_s:.2f},{x:.3f},{y:.3f}"
                for who, (x, y) in zip(
                    ids[now].tolist(), chosen.placed(crowd.position_m[now]).tolist(), strict=True
                )
            ]
    table = folder / f"{name}.csv"
    atomic_write_text(table, "\n".join(["id,time,x,y", *rows]) + "\n")
    corners = np.array([[0, 0], [_WINDOW_M, 0], [_WINDOW_M, chosen.width_m], [0, chosen.width_m]])
    area = shapely.Polygon(chosen.placed(corners))
    atomic_write_text(table.with_suffix(".wkt"), shapely.to_wkt(area) + "\n")
    return table
