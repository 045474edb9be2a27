"""Closed routes of many walkers at once: each follows a loop at an own distance beside its line.

All loops are padded to the same number of corners so that one step moves all walkers at once.
"""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_sim.errors import SimError

_LOOK_AHEAD_M = 5.0
_CORNER_REACHED_M = 0.4


def offset_loop(waypoints_m: FloatArray, offset_m: float) -> FloatArray:
    """(n, 2) corners of the loop moved sideways, positive to the left of the walking direction."""
    leaving = _unit(np.roll(waypoints_m, -1, axis=0) - waypoints_m)
    arriving = np.roll(leaving, 1, axis=0)
    left_of = np.array([[0.0, 1.0], [-1.0, 0.0]])
    normal_sum = (leaving + arriving) @ left_of
    stretch = 1.0 + np.sum(leaving * arriving, axis=1, keepdims=True)
    if (stretch < 0.05).any():
        corner = waypoints_m[int(np.argmin(stretch))]
        raise SimError(
            f"a loop must not turn back on itself, got a hairpin at {corner.tolist()}"
            "; use two corners"
        )
    moved: FloatArray = waypoints_m + offset_m * normal_sum / stretch
    return moved


class Routes:
    """Where each of N walkers goes next. `corners` is (N, K, 2), `n_corners` (N,)."""

    def __init__(self, loops_m: list[FloatArray]) -> None:
        self.n_corners: IntArray = np.array([len(loop) for loop in loops_m], dtype=np.int64)
        self._rows = np.arange(len(loops_m))
        most = int(self.n_corners.max(initial=1))
        self.corners = np.zeros((len(loops_m), most, 2))
        for row, loop in enumerate(loops_m):
            self.corners[row, : len(loop)] = loop
        count = len(loops_m)
        self.target: IntArray = np.zeros(count, dtype=np.int64)
        #: Start (m) and direction of each walker's leg, x before y, and its length (m).
        self._legs = np.zeros((5, count))
        self._measure_leg(self._rows)

    def place(self, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) x and y at the given share [0, 1) of each loop's length; sets targets to match."""
        position = np.zeros((len(self._rows), 2))
        for row, count in enumerate(self.n_corners):
            corners = self.corners[row, :count]
            legs = np.roll(corners, -1, axis=0) - corners
            ends = np.cumsum(np.hypot(legs[:, 0], legs[:, 1]))
            along = share[row] * ends[-1]
            leg = int(np.searchsorted(ends, along, side="right"))
            left = (ends[leg] - along) / np.hypot(*legs[leg])
            position[row] = corners[leg] + (1.0 - left) * legs[leg]
            self.target[row] = (leg + 1) % count
        self._measure_leg(self._rows)
        return position[:, 0].copy(), position[:, 1].copy()

    def headings(self, x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) unit vectors to a point a little ahead on each walker's own line.

        Walkers that have come to the end of a leg turn to the next one.
        """
        heading_x, heading_y, reached = self._headings_on_legs(x_m, y_m)
        if reached.any():
            self.target[reached] = (self.target[reached] + 1) % self.n_corners[reached]
            self._measure_leg(self._rows[reached])
            heading_x, heading_y, _ = self._headings_on_legs(x_m, y_m)
        return heading_x, heading_y

    def _headings_on_legs(
        self, x_m: FloatArray, y_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """(N,) x and y of headings to points ahead on the legs, and who is near a leg's end."""
        start_x, start_y, unit_x, unit_y, length = self._legs
        along = (x_m - start_x) * unit_x + (y_m - start_y) * unit_y
        ahead = np.minimum(np.maximum(along, 0.0) + _LOOK_AHEAD_M, length)
        to_x, to_y = start_x + ahead * unit_x - x_m, start_y + ahead * unit_y - y_m
        distance = np.maximum(np.sqrt(to_x * to_x + to_y * to_y), 1e-9)
        return to_x / distance, to_y / distance, along > length - _CORNER_REACHED_M

    def _measure_leg(self, rows: IntArray) -> None:
        target = self.target[rows]
        start = self.corners[rows, (target - 1) % self.n_corners[rows]]
        leg = self.corners[rows, target] - start
        length = np.hypot(leg[:, 0], leg[:, 1])
        self._legs[:, rows] = *start.T, *(leg.T / length), length


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if (length < 1e-9).any():
        raise SimError("waypoints_m must differ from each other; remove the repeated waypoint")
    return np.asarray(vectors / length)
