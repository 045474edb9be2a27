"""Dwell times by place: found where a region is slower, as often as chance allows where none is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from serd_app.learning.criticism import LEVEL, RecordedTimes
from serd_app.learning.dwell_places import check_dwell_times, place_factors
from serd_core.arrival.chain import arrival_moments
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import (
    NO_FLOW,
    build_navigation_problem,
    with_dwell_times,
)
from serd_core.policies.solved_policy import optimal_policy
from serd_core.semi_markov.models import require_timed, semi_markov_problem
from serd_sim.drivers.strategy import Plan
from tests.conftest import OUTCOMES

#: A room of 6 by 9 cells where nobody walks; the goal is its northern row.
GRID = Grid((0.0, 0.0), 1.0, np.ones((9, 6), dtype=bool))
PROBLEM = with_dwell_times(
    build_navigation_problem(
        grid=GRID,
        flow=np.full(GRID.n_states, NO_FLOW),
        goal_states=np.arange(48, 54),
        wall_distance_m=np.ones(GRID.n_states),
        discount=0.97,
    ),
    patience_s=4.0,
    wait_s=1.0,
)
MODEL = require_timed(PROBLEM.mdp.transitions)
TRUTH = MODEL.parameters_from(np.array(list(OUTCOMES.values())), 1.0, 6.0)
NORTH, EAST = GRID.centers_m[:, 1] > 4.0, GRID.centers_m[:, 0] > 3.0
TABLE = MODEL.local_probabilities(TRUTH)
LEARNED = optimal_policy(PROBLEM, np.eye(len(PROBLEM.feature_names))[0], TABLE)


def demonstrations(n_episodes, seed=0):
    """Drives of one who goes the shortest way, and every third time anywhere."""
    available = PROBLEM.outcome_models.available
    policy = 0.67 * LEARNED.probabilities
    policy += 0.33 * available / available.sum(axis=1, keepdims=True)
    starts = np.repeat([1 / 6, 0.0], [6, 48])
    return sample_timed_decisions(
        PROBLEM.mdp,
        policy,
        TRUTH,
        starts,
        n_episodes=n_episodes,
        n_steps=60,
        rng=np.random.default_rng(seed),
        mean_until_command_s=60.0,
    )


def slowed(drives, where, factor):
    return replace(drives, dwell_s=drives.dwell_s * np.where(where[drives.state], factor, 1.0))


def found_in(drives, seed=0):
    return place_factors(PROBLEM, drives, np.random.default_rng(seed))


def test_a_slower_region_is_found_from_six_drives_with_its_factors():
    found = found_in(slowed(demonstrations(6), NORTH, 2.0))
    assert found.tail <= 0.01
    in_north = NORTH[found.cells]
    assert found.factors[in_north].mean() > 1.1 > 0.9 > found.factors[~in_north].mean()
    assert found.factors.max() / found.factors.min() < 2.0  # toward one by the prior


def test_places_that_are_alike_differ_as_often_as_the_tail_probability_says():
    tails = np.array([found_in(demonstrations(5, seed), seed).tail for seed in range(60)])
    n_found = int((tails <= 0.1).sum())
    assert binom.cdf(n_found, 60, 0.1) > 0.01
    assert binom.sf(n_found - 1, 60, 0.1) > 0.01


def test_factors_and_tail_are_those_of_a_plain_computation():
    drives = slowed(demonstrations(8), NORTH, 1.4)
    found = found_in(drives)
    moved = (drives.next_state != drives.state) & (drives.censored == 0)
    moved &= drives.action != Action.WAIT  # without a flow all moves have one law
    log_s, state = np.log(drives.dwell_s[moved]), drives.state[moved]
    residual = log_s - log_s.mean()
    np.testing.assert_array_equal(found.cells, np.unique(state))
    for cell, factor in zip(found.cells, found.factors, strict=True):
        away = np.linalg.norm(GRID.centers_m[state] - GRID.centers_m[cell], axis=1)
        near = np.exp(-(away**2) / 8.0)
        assert np.log(factor) == pytest.approx((near @ residual) / (near.sum() + 4.0))


@pytest.mark.parametrize(
    ("east_seen", "starts", "mark"),
    [(True, range(6), "holds"), (False, [0, 1], "holds"), (False, [4, 5], "fails")],
)
def test_a_slow_region_contradicts_where_the_drive_goes_without_moves_that_were_seen(
    east_seen, starts, mark
):
    drives = slowed(demonstrations(20), EAST, 3.0)
    if not east_seen:
        drives = drives.select(GRID.centers_m[drives.state, 0] < 5.0)
    plan = Plan(problem=PROBLEM, learned=LEARNED, draws=TRUTH[None], timeout_s=120.0)
    rng = np.random.default_rng(0)
    check = check_dwell_times(plan, drives, np.array(starts), rng, level=LEVEL, margin=1.1)
    assert "(tail probability 0.00" in check.sentence
    assert check.mark == mark, check.sentence


@pytest.mark.parametrize(("row", "mark"), [(8, "holds"), (6, "holds"), (3, "fails")])
def test_a_forecast_through_cells_from_which_nothing_moved_is_not_supported(row, mark):
    drives = demonstrations(20)
    drives = drives.select(GRID.centers_m[drives.state, 1] < row + 1.0)
    plan = Plan(problem=PROBLEM, learned=LEARNED, draws=TRUTH[None], timeout_s=120.0)
    rng = np.random.default_rng(0)
    check = check_dwell_times(plan, drives, np.arange(6), rng, level=LEVEL, margin=1.1)
    assert check.mark == mark, check.sentence
    everywhere = semi_markov_problem(PROBLEM, log_pace=np.full(GRID.n_states, np.log(2.0)))
    twice_s, once_s = (
        arrival_moments(each, LEARNED.probabilities, TRUTH, 0.2)[0][:6].mean()
        for each in (everywhere, PROBLEM)
    )
    stated = float(check.sentence.split("drive would take ")[1].split()[0])
    # A move leaves each of eight rows; waits of a given duration are not slower.
    assert stated == pytest.approx(1.0 + max(7 - row, 0) / 8 * (twice_s / once_s - 1.0), abs=0.03)


@pytest.mark.parametrize("pace", [1.0, -0.5])
def test_learned_paces_of_places_are_in_both_times_that_are_compared(pace):
    problem = semi_markov_problem(PROBLEM, log_pace=np.where(NORTH, pace, 0.0))
    plan = Plan(problem=problem, learned=LEARNED, draws=TRUTH[None], timeout_s=120.0)
    rng, drives = np.random.default_rng(0), slowed(demonstrations(30), NORTH, np.exp(pace))
    check = check_dwell_times(plan, drives, np.arange(6), rng, level=LEVEL, margin=1.1)
    assert "would take 1.00 times" in check.sentence


@pytest.mark.parametrize(
    ("n", "n_early", "contradicts"),
    [(8, 8, True), (8, 0, True), (8, 7, False), (6, 6, True), (5, 5, False), (8, 4, False)],
)
def test_drives_on_one_side_of_the_middle_contradict_where_chance_does_not_explain_them(
    n, n_early, contradicts
):
    early = np.arange(n) < n_early
    recorded = RecordedTimes(np.full(n, 10.0), np.zeros(n, dtype=bool), early, ~early)
    assert recorded.contradict == contradicts
    assert (2 * binom.sf(max(n_early, n - n_early) - 1, n, 0.5) <= LEVEL) == contradicts
