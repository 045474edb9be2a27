"""The closed-loop benchmark's plan and its summary."""

import math
from dataclasses import fields

import pytest

from lab.benchmarks.driving.closed_loop import ClosedLoopPlan
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


def test_the_plan_has_every_combination_once():
    plan = ClosedLoopPlan(n_seeds=3)
    assert len(set(plan.tasks)) == len(plan.tasks) == 2 * 4 * 2 * 2 * 3
    assert sum(task.people_from == "scan" for task in plan.tasks) == 4 * 2 * 2 * 3


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


def test_the_interval_of_the_arrival_rate_is_the_exact_one():
    """Closed form where all n arrive: the lower end is 0.025 ** (1 / n)."""
    (summary,) = summarise([row(seed, "arrived", 50.0) for seed in (1, 2, 3)])
    assert (summary.arrival_low, summary.arrival_high) == pytest.approx((0.025 ** (1 / 3), 1.0))
