"""The summary of episodes that the closed-loop benchmark prints."""

import math
from dataclasses import fields

import pytest

from serd_sim.episodes.batch import summarise
from serd_sim.episodes.metrics import EpisodeMetrics


def row(seed, outcome, time_s, **values):
    base = {
        **dict.fromkeys(("scenario", "start_area", "driver", "people_from"), "any"),
        "n_people": 30,
        "guarded": 1,
        "seed": seed,
        "outcome": outcome,
        "time_of_arrival_s": time_s,
        "distance_m": 20.0 + seed,
        "minimum_person_distance_m": 0.1 * seed,
        "robot_on_person": 0,
        "person_on_robot": seed,
        "robot_on_wall": 0,
        **{each.name: 0.5 for each in fields(EpisodeMetrics)},
    }
    return base | values


def test_a_summary_averages_over_the_episodes_of_a_condition():
    rows = [row(1, "arrived", 50.0), row(2, "arrived", 60.0), row(3, "timeout", math.nan)]
    (summary,) = summarise(rows)
    assert summary.n_episodes == 3
    assert summary.n_arrived == 2
    assert summary.mean_time_of_arrival_s == pytest.approx(55.0)
    assert summary.mean_distance_m == pytest.approx(22.0)
    assert summary.person_on_robot == pytest.approx(2.0)
    assert summary.minimum_person_distance_m == pytest.approx(0.1)
    (late,) = summarise([row(1, "timeout", math.nan)])
    assert math.isnan(late.mean_time_of_arrival_s)
    # Closed form of the exact interval where all n arrive: it begins at 0.025 ** (1 / n).
    (all_in,) = summarise([row(seed, "arrived", 50.0) for seed in (1, 2, 3)])
    assert (all_in.arrival_low, all_in.arrival_high) == pytest.approx((0.025 ** (1 / 3), 1.0))
