"""What a scan shows of people."""

import math

import numpy as np
import pytest

from serd_sim.safety.scan import Scan, ScanGeometry, shown_by

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
