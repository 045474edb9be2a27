"""What a lidar seems to mean by ranges of 0."""

import math

import numpy as np
import pytest

from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.zero_ranges import ZeroRanges

GEOMETRY = ScanGeometry(-math.pi, math.tau / 360, 0.12, 3.5)


def zeros_of(*changes):
    """Zeros of scans of a room with walls at 2 m, each changed by (rays, value) pairs."""
    zeros = ZeroRanges()
    for change in changes:
        ranges_m = np.full(360, 2.0, dtype=np.float32)
        for rays, value in change:
            ranges_m[rays] = value
        zeros.take(Scan(0.0, ranges_m, GEOMETRY))
    return zeros


SIDES = slice(90, 100), slice(130, 140)
ZERO = slice(100, 130), 0.0


@pytest.mark.parametrize(
    ("change", "meaning"),
    [
        ([(slice(0, 360), 0.0)], "unknown"),
        ([(slice(0, 360), np.nan), ZERO], "unknown"),
        ([(slice(0, 360), -np.inf), ZERO], "unknown"),
        ([ZERO], "free"),
        ([ZERO, (slice(200, 210), np.inf)], "unknown"),
        ([ZERO, *((side, 0.2) for side in SIDES)], "obstacle"),
        ([ZERO, *((side, 1.0) for side in SIDES)], "unknown"),
        ([(slice(0, 360, 10), 0.0)], "unknown"),
        ([(slice(350, 360), 0.0), (slice(0, 10), 0.0)], "free"),
        ([(5, 0.0)], None),
        ([], None),
        ([(slice(0, 90), np.nan), (slice(90, 180), -np.inf)], None),
    ],
)
def test_zeros_are_recognised_by_what_stands_beside_them(change, meaning):
    assert zeros_of(change).seems_to_be == meaning
    assert zeros_of(*[change] * 5).seems_to_be == meaning


def test_the_sentence_names_what_to_set_where_it_is_set_otherwise():
    zeros = zeros_of([ZERO])
    assert zeros.share == pytest.approx(30 / 360)
    assert zeros.sentence("unknown") == (
        "8 % of the ranges are 0, which seems to mean no return; set zero_is to free if the manual"
        " of the lidar agrees, it is unknown"
    )
    assert zeros.sentence("free") == "8 % of the ranges are 0, which seems to mean no return"
    assert zeros_of([]).sentence("unknown") == ""
