"""Arrival by the chain of a policy: closed forms, the chain run backwards, and drawn drives."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import gamma, nbinom

import serd_core as sc
from serd_core import checks
from serd_core.arrival.arriving_policy import likely_by_moments
from serd_core.arrival.chain import (
    RenewalChain,
    arrival_moments,
    dwell_steps,
    renewal_arrival,
    timed_arrival,
)
from serd_core.grid.grid import Action
from serd_core.grid.navigation import with_dwell_times
from support.arrival_twin import arrival_by_state
from support.refusals import refusals
from support.small_problems import always, room

ONE_STEP = np.array([[0.0, 1.0]])


def line(n_moves):
    """States 0 to n, each of which leads to the next one."""
    state, goal = np.arange(n_moves), np.arange(n_moves + 1) == n_moves
    return RenewalChain(state, state + 1, np.ones(n_moves), np.zeros(n_moves, int), goal)


def by_periods(problem, policy, table, n_steps):
    parameters = problem.mdp.transitions.fixed_parameters_of(np.asarray(table, dtype=float))
    return timed_arrival(problem, policy, parameters, 1.0, n_steps)


def random_case(seed):
    """A 4 x 3 room with random flow, goal, policy and outcomes."""
    rng = np.random.default_rng(seed)
    problem = room(4, 3, int(rng.integers(12)), rng.integers(1, 5, 12))
    policy = rng.dirichlet(np.ones(5), 12)
    policy[problem.goal_states] = np.eye(5)[Action.WAIT]
    return problem, policy, rng.dirichlet(np.ones(5), 4)


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 10_000))
def test_periods_and_laws_of_one_step_give_the_chain_of_the_policy_run_backwards(seed):
    problem, policy, table = random_case(seed)
    expected = arrival_by_state(problem, policy, table, 60)
    timed = sc.semi_markov_problem(problem, law_of=np.full((4, 5), -1), stay_s=2.0)
    truth = timed.mdp.transitions.parameters_from(table, 1.0, 1.0)
    for found in (
        by_periods(problem, policy, table, 60),
        timed_arrival(timed, policy, truth, 2.0, 60),
    ):
        away = np.arange(12) != problem.goal_states[0]
        np.testing.assert_allclose(found.cdf[:, away], expected.cdf[:, away], atol=3e-8)
        np.testing.assert_allclose(found.arrival_probability, expected.arrival_probability)


def test_the_remaining_time_through_a_corridor_is_negative_binomial():
    problem = room(6, 1, 5)
    table = np.tile([0.6, 0.4, 0, 0, 0], (4, 1))
    found = by_periods(problem, always(problem, Action.NORTH), table, 40)
    for state in range(5):
        expected = nbinom(5 - state, 0.4).cdf(np.arange(41) - 5 + state)
        np.testing.assert_allclose(found.cdf[:, state], expected, atol=3e-8)


def test_a_trap_is_left_out_of_the_probability_of_ever_arriving():
    """Forward 0.6, back 0.4; below cell 2 the policy stays: gambler's ruin."""
    problem, table = room(6, 1, 5), np.tile([0, 0.6, 0, 0.4, 0], (4, 1))
    policy, table[3] = always(problem, Action.NORTH), [1, 0, 0, 0, 0]
    policy[:2] = np.eye(5)[Action.WAIT]
    found, ratio = by_periods(problem, policy, table, 700), 0.4 / 0.6
    assert found.arrival_probability[2] == pytest.approx((1 - ratio) / (1 - ratio**4))
    assert found.cdf[-1, 2] == pytest.approx(found.arrival_probability[2], abs=1e-4)


def test_known_transitions_need_no_parameters_and_goals_are_numbers_or_a_mask():
    world = sc.from_transitions(np.full((2, 1, 2), 0.5), np.ones((2, 1)), discount=0.9)
    for goals in ([1], [False, True]):
        problem = SimpleNamespace(mdp=world.mdp, goal_states=goals)
        found = timed_arrival(problem, np.ones((2, 1)), np.zeros(0), 1.0, 2)
        np.testing.assert_allclose(found.cdf, [[0, 1], [0.5, 1], [0.75, 1]], atol=3e-8)


def test_a_goal_that_can_be_left_counts_as_arrived_all_the_same():
    moves = np.array([0, 1]), np.array([1, 0]), np.ones(2), np.zeros(2, int)
    found = renewal_arrival(RenewalChain(*moves, np.array([False, True])), ONE_STEP, 2)
    np.testing.assert_allclose(found.cdf, [[0, 1], [1, 1], [1, 1]], atol=3e-8)


def test_moves_of_gamma_times_add_up_to_a_gamma_distribution():
    step_s, shape, scale_s = 0.05, 4.0, 0.25
    edges = (np.arange(400) + 0.5) * step_s
    cdf = gamma(shape, scale=scale_s).cdf(edges)
    found = renewal_arrival(line(5), np.diff(cdf, prepend=0.0)[None], 300).cdf[:, 0]
    np.testing.assert_allclose(found, gamma(5 * shape, scale=scale_s).cdf(edges[:301]), atol=2e-4)


def timed_room(log_pace=None):
    problem = with_dwell_times(room(6, 3, 17), patience_s=4.0, wait_s=1.0, log_pace=log_pace)
    table = np.random.default_rng(5).dirichlet([1.0, 12.0, 1.0, 1.0, 1.0], 4)
    model = problem.mdp.transitions
    truth = model.parameters_from(table, np.array([0.9, 1.6, 1.2]), np.array([9.0, 4.0, 6.0]))
    policy = sc.optimal_policy(
        problem, np.ones(len(problem.feature_names)), model.local_probabilities(truth)
    )
    return problem, truth, policy.probabilities


def test_drawn_drives_arrive_as_predicted_with_stays_waits_and_places():
    problem, truth, policy = timed_room(np.random.default_rng(1).normal(0.0, 0.4, 18))
    size = {"n_episodes": 1500, "n_steps": 400, "rng": np.random.default_rng(4)}
    drives = sc.sample_timed_decisions(problem.mdp, policy, truth, np.eye(18)[0], **size)
    last = np.append(np.flatnonzero(np.diff(drives.episode)), len(drives) - 1)
    times_s = drives.time_s[last] + drives.dwell_s[last]
    predicted = timed_arrival(problem, policy, truth, 0.1, 600).cdf[:, 0]
    measured = np.searchsorted(np.sort(times_s), 0.1 * np.arange(601) + 0.05) / len(times_s)
    # Dvoretzky, Kiefer and Wolfowitz: exceeded once in 10^6.
    assert np.abs(measured - predicted).max() < np.sqrt(np.log(2e6) / 3000)
    stays = drives.state == drives.next_state
    assert set(np.unique(drives.dwell_s[stays])) == {1.0, 4.0}  # waits, and patience


def test_steps_keep_the_mean_of_a_time_also_where_it_varies_less_than_a_step():
    mean_s, shape = (
        np.array([2.0, 0.83, 0.83, 1.25, 0.05, 0.03, 99.0]),
        np.array([20.0, 400.0, 1e7, np.inf, 0.7, np.inf, 400.0]),
    )
    mass = dwell_steps(mean_s, shape, 0.2, 100)
    np.testing.assert_allclose(0.2 * mass[:6] @ np.arange(101), mean_s[:6], rtol=1e-6)
    np.testing.assert_allclose(mass[:6].sum(axis=1), 1.0, atol=1e-9)
    assert mass[6].sum() < 1e-9
    fixed = dwell_steps(np.array([1.3, 1.34, 0.03, 99.0]), np.full(4, np.inf), 0.1, 100)
    expected = np.zeros((4, 101))
    expected[0, 13], expected[1, 13:15], expected[2, :2] = 1.0, (0.6, 0.4), (0.7, 0.3)
    np.testing.assert_allclose(fixed, expected, atol=1e-12)


PROBLEM, POLICY, TABLE = random_case(0)
WORLD = sc.from_transitions(np.full((2, 1, 2), 0.5), np.ones((2, 1)), discount=0.9)


def test_a_table_that_would_not_fit_into_memory_is_refused(monkeypatch):
    monkeypatch.setattr(checks, "memory_limit", lambda: 30_000)
    with pytest.raises(sc.SerdError, match="within 100 steps from each of 12 states must fit into"):
        by_periods(PROBLEM, POLICY, TABLE, 100)
    assert by_periods(PROBLEM, POLICY, TABLE, 50).cdf.shape == (51, 12)


def arrival(problem=PROBLEM, policy=POLICY, n_parameters=20):
    return lambda: timed_arrival(problem, policy, np.zeros(n_parameters), 1.0, 3)


ELSEWHERE = SimpleNamespace(mdp=WORLD.mdp, goal_states=[9])
test_wrong_arguments_are_refused_by_name = refusals(
    (arrival(policy=np.tile(np.eye(5)[1], (12, 1))), r"policy\[\d+, 1\] must be a probability of"),
    (arrival(n_parameters=3), r"parameters must have shape \(20\), got \(3,\)"),
    (arrival(WORLD), "problem must have an mdp and goal_states, got a TabularProblem"),
    (arrival(ELSEWHERE), r"goal_states\[0\] must be"),
)


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 10_000))
def test_the_moments_are_those_of_the_law_and_prove_no_more_than_it(seed):
    problem, policy, table = random_case(seed)
    timed = with_dwell_times(problem, patience_s=3.0, wait_s=1.0)
    model = timed.mdp.transitions
    truth = model.parameters_from(table, np.full(model.n_laws, 1.5), np.full(model.n_laws, 4.0))
    mean_s, square_s2 = arrival_moments(timed, policy, truth, 0.25)
    law = timed_arrival(timed, policy, truth, 0.25, 4000)
    late = 1.0 - law.cdf[:-1]
    certain = np.isfinite(mean_s) & (law.cdf[-1] > 1.0 - 1e-9)
    times_s = 0.25 * np.arange(4000)[:, None]
    np.testing.assert_allclose(mean_s[certain], 0.25 * late.sum(axis=0)[certain], rtol=1e-5)
    of_law = (late * (2.0 * times_s + 0.25) * 0.25).sum(axis=0)[certain]
    assert (square_s2[certain] >= of_law * (1.0 - 1e-5)).all()
    np.testing.assert_allclose(square_s2[certain], of_law, rtol=0.05, atol=0.5)
    for within_s in (5.0, 20.0, 80.0):
        proven = likely_by_moments(mean_s, square_s2, within_s)
        assert (law.within(round(within_s / 0.25))[proven] >= 0.5).all()
