"""Tracks of people from detections: nearest neighbours and an alpha-beta filter.

x+ = x + v dt;  r = z - x+;  x = x+ + alpha r;  v = v + beta / dt r
"""

import numpy as np

from serd_core.arrays import FloatArray, IntArray

_ALPHA, _BETA = 0.6, 0.25
#: How far a detection may be from a track's prediction.
_GATE_M = 0.6
#: Life unseen.
_MEMORY_S = 0.5
FASTEST_MPS = 2.0


class PeopleTracker:
    """Positions, velocities and lasting numbers of people, from detections to detections."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Discard all tracks."""
        self.position_m: FloatArray = np.zeros((0, 2))
        self.velocity_mps: FloatArray = np.zeros((0, 2))
        self.identity: IntArray = np.zeros(0, dtype=np.int64)
        self._seen_s: FloatArray = np.zeros(0)
        self._time_s: float | None = None
        self._updated_s: float | None = None
        self._next_identity = 0

    def predict(self, time_s: float) -> None:
        """Move all tracks on to a time."""
        if self._time_s is not None:
            self.position_m = self.position_m + (time_s - self._time_s) * self.velocity_mps
        self._time_s = time_s

    def update(self, detections_m: FloatArray, time_s: float) -> None:
        """Take the (K, 2) detections of a scan at a time."""
        # Not since the last prediction, which may be later than this scan.
        step_s = 0.1 if self._updated_s is None else max(time_s - self._updated_s, 1e-3)
        self._updated_s = time_s
        self.predict(time_s)
        free = np.ones(len(detections_m), dtype=np.bool_)
        for track, detection in self._pairs(detections_m):
            self._correct(track, detections_m[detection], step_s)
            self._seen_s[track] = time_s
            free[detection] = False
        self._forget(time_s)
        self._start_tracks(detections_m[free], time_s)

    def _pairs(self, detections_m: FloatArray) -> list[tuple[int, int]]:
        """Track and detection numbers, nearest first, each at most once, within the gate."""
        away = np.linalg.norm(self.position_m[:, None] - detections_m[None, :], axis=2)
        pairs: list[tuple[int, int]] = []
        tracks, detections = np.nonzero(away < _GATE_M)
        for best in np.argsort(away[tracks, detections], kind="stable"):
            track, detection = int(tracks[best]), int(detections[best])
            if all(track != t and detection != d for t, d in pairs):
                pairs.append((track, detection))
        return pairs

    def _correct(self, track: int, detection_m: FloatArray, step_s: float) -> None:
        residual = detection_m - self.position_m[track]
        self.position_m[track] += _ALPHA * residual
        velocity = self.velocity_mps[track] + _BETA / step_s * residual
        speed = float(np.hypot(*velocity))
        self.velocity_mps[track] = velocity * min(1.0, FASTEST_MPS / max(speed, 1e-9))

    def _forget(self, time_s: float) -> None:
        known = time_s - self._seen_s <= _MEMORY_S
        self.position_m, self.velocity_mps = self.position_m[known], self.velocity_mps[known]
        self.identity, self._seen_s = self.identity[known], self._seen_s[known]

    def _start_tracks(self, detections_m: FloatArray, time_s: float) -> None:
        count = len(detections_m)
        numbers = self._next_identity + np.arange(count, dtype=np.int64)
        self._next_identity += count
        self.position_m = np.concatenate([self.position_m, detections_m])
        self.velocity_mps = np.concatenate([self.velocity_mps, np.zeros((count, 2))])
        self.identity = np.concatenate([self.identity, numbers])
        self._seen_s = np.concatenate([self._seen_s, np.full(count, time_s)])
