"""The people around a robot at its crossings: those last seen, unless that was long ago."""

from types import SimpleNamespace

import numpy as np

from serd_app.demonstrations.recorded_crossings import people_around
from serd_app.drives.recorded_people import Sighting

BAG = SimpleNamespace(crowd=None)


def seen(time_s: float, *places_m: tuple[float, float, float]) -> Sighting:
    people = SimpleNamespace(position_m=np.array(places_m, dtype=np.float64).reshape(-1, 3))
    return Sighting(time_s, people, b"")


def counts(sightings, *times_s: float) -> list[int | None]:
    found = people_around(BAG, 0, sightings)(np.array(times_s))
    return [None if people is None else len(people) for people in found]


def test_the_last_sighting_at_most_a_second_before_counts():
    sightings = [seen(1.0, (2.5, 2.5, 0.0)), seen(2.0), seen(4.0, (2.5, 1.5, 0.0), (0.5, 0.5, 0.0))]
    assert counts(sightings, 0.5, 1.5, 2.0, 4.2, 5.0, 5.01) == [None, 1, 0, 2, 2, None]


def test_people_without_a_place_are_left_out():
    assert counts([seen(1.0, (2.5, 2.5, 0.0), (np.nan, 1.0, 0.0))], 1.0) == [1]


def test_sightings_of_a_clock_that_goes_back_are_not_known():
    person = (2.5, 2.5, 0.0)
    assert counts([seen(2.0, person), seen(1.0, person)], 1.0, 2.0) == [None, None]
