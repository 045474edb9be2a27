"""Arrival by decisions that take time: known cases, and drawn drives."""

import numpy as np
import pytest

import serd_core as sc
from serd_core.grid.navigation import with_dwell_times
from serd_core.semi_markov.arrival import dwell_steps, timed_arrival
from support.semi_markov import timed_ring
from support.small_problems import room


def timed_room(log_pace=None):
    problem = with_dwell_times(room(6, 3, 17), patience_s=4.0, wait_s=1.0, log_pace=log_pace)
    rng = np.random.default_rng(5)
    table = rng.dirichlet([1.0, 12.0, 1.0, 1.0, 1.0], 4)
    model = problem.mdp.transitions
    truth = model.parameters_from(table, np.array([0.9, 1.6, 1.2]), np.array([9.0, 4.0, 6.0]))
    policy = sc.optimal_policy(
        problem, np.ones(len(problem.feature_names)), model.local_probabilities(truth)
    )
    return problem, truth, policy.probabilities


def test_drawn_drives_arrive_as_predicted_with_stays_waits_and_places():
    log_pace = np.random.default_rng(1).normal(0.0, 0.4, 18)
    problem, truth, policy = timed_room(log_pace)
    start = np.eye(18)[0]
    drives = sc.sample_timed_decisions(
        problem.mdp,
        policy,
        truth,
        start,
        n_episodes=3000,
        n_steps=400,
        rng=np.random.default_rng(4),
    )
    last = np.append(np.flatnonzero(np.diff(drives.episode)), len(drives) - 1)
    times_s = drives.time_s[last] + drives.dwell_s[last]
    predicted = timed_arrival(problem, policy, truth, 0.1, 600).cdf[:, 0]
    measured = np.searchsorted(np.sort(times_s), 0.1 * np.arange(601) + 0.05) / len(times_s)
    # Dvoretzky, Kiefer and Wolfowitz: exceeded once in 10^6.
    assert np.abs(measured - predicted).max() < np.sqrt(np.log(2e6) / 6000)
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


def test_times_that_do_not_vary_are_the_steps_beside_them():
    mass = dwell_steps(np.array([1.3, 1.34, 0.03, 99.0]), np.full(4, np.inf), 0.1, 100)
    expected = np.zeros((4, 101))
    expected[0, 13], expected[1, 13:15], expected[2, :2] = 1.0, (0.6, 0.4), (0.7, 0.3)
    np.testing.assert_allclose(mass, expected, atol=1e-12)


def test_slower_places_arrive_later_and_expected_seconds_are_those_of_the_law():
    problem, truth, policy = timed_room()
    slow = sc.semi_markov_problem(problem, log_pace=np.full(18, np.log(2.0)))
    here, there = (
        timed_arrival(each, policy, truth, 0.1, 900).mean_steps[0] * 0.1 for each in (problem, slow)
    )
    seconds = problem.mdp.transitions.expected_seconds(truth)
    assert seconds.shape == problem.mdp.available.shape
    assert here < there < 2.0 * here + 1e-6
    _, ring_truth = timed_ring()
    with pytest.raises(sc.SerdError, match="problem must have dwell times"):
        timed_arrival(room(4, 2, 7), np.ones((8, 5)) / 5, ring_truth, 0.1, 10)
