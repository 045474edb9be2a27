"""What a scan shows of people, and what a lidar seems to mean by ranges of 0."""

import math

import numpy as np
import pytest

from serd_sim.safety.scan import Scan, ScanGeometry, shown_by
from serd_sim.safety.zero_ranges import ZeroRanges

GEOMETRY = ScanGeometry(-math.pi, math.tau / 720, 0.1, 10.0)
RADIUS_M = 0.25


def scan_of(*discs, background_m=8.0):
    """A scan of round bodies at (distance_m, bearing_rad) in front of a background."""
    ranges_m = np.full(720, background_m, dtype=np.float32)
    angle = GEOMETRY.angle_min_rad + GEOMETRY.angle_increment_rad * np.arange(720)
    for away_m, bearing in discs:
        aside = np.abs(np.remainder(angle - bearing + math.pi, math.tau) - math.pi)
        on_body = aside < math.asin(RADIUS_M / away_m)
        ranges_m[on_body] = np.minimum(ranges_m[on_body], away_m - RADIUS_M)
    return Scan(0.0, ranges_m, GEOMETRY)


def at(away_m, bearing):
    return [away_m * math.cos(bearing), away_m * math.sin(bearing)]


@pytest.mark.parametrize("bearing", [0.0, 1.0, math.pi, -math.pi + 0.01])
def test_a_person_is_seen_unseen_or_hidden(bearing):
    person = np.array([at(3.0, bearing)])
    assert shown_by(scan_of((3.0, bearing)), person, RADIUS_M) == (1, 0)
    assert shown_by(scan_of((3.3, bearing)), person, RADIUS_M) == (1, 0)
    assert shown_by(scan_of(), person, RADIUS_M) == (0, 1)
    assert shown_by(scan_of((3.0, bearing + 0.5)), person, RADIUS_M) == (0, 1)
    assert shown_by(scan_of((1.5, bearing)), person, RADIUS_M) == (0, 0)


def test_people_whom_no_scan_could_show_count_as_neither():
    assert shown_by(scan_of(), np.array([at(5.5, 0.0), at(0.4, 1.0)]), RADIUS_M) == (0, 0)
    lost = Scan(0.0, np.full(720, np.inf, dtype=np.float32), GEOMETRY)
    assert shown_by(lost, np.array([at(3.0, 0.0)]), RADIUS_M) == (0, 0)
    assert shown_by(scan_of(), np.zeros((0, 2)), RADIUS_M) == (0, 0)


SHORT = ScanGeometry(-math.pi, math.tau / 360, 0.12, 3.5)


def zeros_of(*changes):
    """Zeros of scans of a room with walls at 2 m, each changed by (rays, value) pairs."""
    zeros = ZeroRanges()
    for change in changes:
        ranges_m = np.full(360, 2.0, dtype=np.float32)
        for rays, value in change:
            ranges_m[rays] = value
        zeros.take(Scan(0.0, ranges_m, SHORT))
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
