"""What a lidar seems to mean by ranges of 0, which drivers use for different things.

Zeros between far returns, of a lidar that never sends inf, are rays without a return. Zeros between
near returns are too near. Others state nothing.
"""

from collections import Counter

import numpy as np

from serd_sim.safety.known_space import runs_of
from serd_sim.safety.scan import Scan, ZeroIs

#: Share of a scan's rays from which zeros count.
_FEWEST = 0.02
#: Share of the zeros on which a meaning must agree.
_AGREE = 0.6
#: Returns beside zeros are far from this share of range_max on, and near up to this distance (m)
#: or twice range_min.
_FAR, _NEAR_M = 0.5, 0.3
_LEAST_RUN = 3
_MEANINGS = {"free": "no return", "obstacle": "too near", "unknown": "nothing"}


class ZeroRanges:
    """Counts the zeros of scans by what stands beside them.

    >>> from serd_sim.safety.scan import ScanGeometry
    >>> ranges = np.array([4.0, 0.0, 0.0, 0.0, 4.5, 4.0], dtype=np.float32)
    >>> zeros = ZeroRanges()
    >>> zeros.take(Scan(0.0, ranges, ScanGeometry(0.0, 0.1, 0.1, 5.0)))
    >>> zeros.seems_to_be
    'free'
    """

    def __init__(self) -> None:
        self._n_rays = 0
        self._sends_inf = False
        self._n_by_meaning: Counter[ZeroIs] = Counter()

    def take(self, scan: Scan) -> None:
        """Count a scan as it came."""
        self._n_rays += len(scan.ranges_m)
        zero = scan.ranges_m == 0.0
        self._sends_inf |= bool(np.isposinf(scan.ranges_m).any())
        near_m = max(_NEAR_M, 2.0 * scan.geometry.range_min_m)
        far_m = _FAR * scan.geometry.range_max_m
        for run in runs_of(zero, closes=scan.geometry.closes(len(zero))):
            beside_m = scan.ranges_m[np.array([run[0] - 1, run[-1] + 1]) % len(zero)]
            sides_m = beside_m[np.isfinite(beside_m) & (beside_m > 0.0)]
            meaning: ZeroIs = "unknown"
            if len(sides_m) == 2 and len(run) >= _LEAST_RUN and (sides_m >= far_m).all():
                meaning = "free"
            elif len(sides_m) == 2 and (sides_m <= near_m).all():
                meaning = "obstacle"
            self._n_by_meaning[meaning] += len(run)

    @property
    def share(self) -> float:
        """Share of the rays that are 0."""
        return self._n_by_meaning.total() / max(self._n_rays, 1)

    @property
    def seems_to_be(self) -> ZeroIs | None:
        """What 0 seems to be, None where there are hardly any."""
        if self.share < _FEWEST:
            return None
        meaning, count = self._n_by_meaning.most_common(1)[0]
        if count < _AGREE * self._n_by_meaning.total() or (meaning == "free" and self._sends_inf):
            return "unknown"
        return meaning

    def sentence(self, zero_is: ZeroIs) -> str:
        """What the zeros seem to mean and what to set where `zero_is` differs; empty without."""
        seems = self.seems_to_be
        if seems is None:
            return ""
        found = f"{100.0 * self.share:.0f} % of the ranges are 0"
        text = f"{found}, which seems to mean {_MEANINGS[seems]}"
        if seems == zero_is:
            return text
        return f"{text}; set zero_is to {seems} if the manual of the lidar agrees, it is {zero_is}"
