"""The arrival bands benchmark: its cases, and how far a time is from a band."""

from collections import Counter

from lab.benchmarks.driving.arrival_bands import (
    N_DEMONSTRATIONS,
    N_EPISODES,
    PLACES,
    SIZES,
    cases,
    group_of,
    late,
)


def test_wherever_it_is_stopped_places_have_equal_numbers_of_episodes():
    found = list(cases())
    for end in (len(PLACES), 3 * len(PLACES), len(found)):
        counts = Counter((row["scenario"], row["people"], row["start"]) for row in found[:end])
        assert len(counts) == len(PLACES)
        assert len(set(counts.values())) == 1


def test_every_group_of_demonstrations_drives():
    for size in SIZES:
        groups = {group_of(size, episode) for episode in range(N_EPISODES)}
        assert groups == set(range(N_DEMONSTRATIONS // size))


def test_a_time_is_early_within_or_late():
    band_s = 40.0, 44.0
    assert [late(band_s, time_s) for time_s in (39.5, 40.0, 44.0, 46.0)] == [-0.5, 0.0, 0.0, 2.0]
    assert late(band_s, float("inf")) == float("inf")
    assert late((40.0, float("inf")), float("inf")) == 0.0
