"""The closed-loop benchmark's plan and its summary."""

import math

import pytest

from benchmarks.driving.closed_loop import ClosedLoopPlan
from serd_core.errors import SerdError
from sim.episodes.batch_summary import summarise, wilson_interval


def row(seed, outcome, time_s, **values):
    base = {
        "planner": "dwa",
        "scenario": "hallway",
        "n_people": 30,
        "start_area": "train",
        "driver": "expert_with_flow",
        "people_from": "given",
        "seed": seed,
        "outcome": outcome,
        "time_of_arrival_s": time_s,
        "distance_m": 20.0 + seed,
        "minimum_person_distance_m": 0.1 * seed,
        "intimate_share": 0.1,
        "personal_share": 0.5,
        "robot_on_person": 0,
        "person_on_robot": seed,
        "robot_on_wall": 0,
        "mean_abs_acceleration_mps2": 1.0,
        "mean_abs_turn_acceleration_radps2": 2.0,
    }
    return base | values


def test_the_plan_has_every_combination_once():
    plan = ClosedLoopPlan(n_seeds=3)
    assert len(set(plan.tasks)) == len(plan.tasks) == 2 * 2 * 4 * 2 * 2 * 3
    assert sum(task.people_from == "scan" for task in plan.tasks) == 2 * 4 * 2 * 2 * 3


def test_a_summary_averages_over_the_episodes_of_a_condition():
    rows = [row(1, "arrived", 50.0), row(2, "arrived", 60.0), row(3, "timeout", math.nan)]
    (summary,) = summarise(rows)
    assert summary.n_episodes == 3
    assert summary.arrival_rate == pytest.approx(2 / 3)
    assert summary.mean_time_of_arrival_s == pytest.approx(55.0)
    assert summary.mean_distance_m == pytest.approx(22.0)
    assert summary.person_on_robot == pytest.approx(2.0)
    assert summary.minimum_person_distance_m == pytest.approx(0.1)


def test_conditions_are_kept_apart():
    rows = [row(1, "arrived", 50.0), row(1, "arrived", 40.0, planner="mppi")]
    assert [summary.planner for summary in summarise(rows)] == ["dwa", "mppi"]


def test_a_condition_in_which_nobody_arrives_has_no_time_of_arrival():
    (summary,) = summarise([row(1, "timeout", math.nan)])
    assert math.isnan(summary.mean_time_of_arrival_s)


def test_a_plan_without_seeds_is_refused():
    with pytest.raises(SerdError, match="n_seeds must be at least 1, got 0; use 20"):
        ClosedLoopPlan(n_seeds=0)


def test_the_interval_of_the_arrival_rate_is_wilsons():
    """Closed form (Wilson 1927): (p + z2/2n +- z sqrt(p(1-p)/n + z2/4n2)) / (1 + z2/n)."""
    z, n, p = 1.959963984540054, 20, 0.95
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    assert wilson_interval(19, 20) == pytest.approx((centre - half, centre + half))
    assert wilson_interval(20, 20)[1] == 1.0
