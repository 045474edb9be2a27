"""Problems over a number of periods, against backward induction."""

import numpy as np
import pytest
from scipy.special import logsumexp

import serd_core as sc
from serd_core.dynamics.transition_model import Transitions
from support.refusals import refusals

WEIGHTS = np.array([1.5, -0.7])
TRUTH = np.array([[0.7, 0.2, 0.1], [0.1, 0.3, 0.6]])


def outcome_problem(seed: int = 0, n_states: int = 6):
    rng = np.random.default_rng(seed)
    available = rng.random((n_states, 3)) < 0.8
    available[:, 0] = True
    tables = rng.integers(n_states, size=(n_states, 3, 3)), rng.integers(2, size=(n_states, 3))
    models = sc.OutcomeModels(*tables, available, 2)
    features = rng.normal(size=(n_states, 3, 2))
    return sc.TabularProblem(sc.Mdp(models, 0.9), features, ("one", "two"))


def backward_induction(problem, table, features, terminal):
    """(T, S, A) soft policies, one period after the other from the last."""
    value, policies = terminal @ WEIGHTS, []
    for period in reversed(range(len(features))):
        quality = features[period] @ WEIGHTS + problem.mdp.discount * table @ value
        quality = np.where(problem.mdp.available, quality, -np.inf)
        value = logsumexp(quality, axis=1)
        policies.append(np.exp(quality - value[:, None]))
    return np.array(policies[::-1])


@pytest.mark.parametrize("seed", range(3))
def test_policies_are_those_of_backward_induction(seed):
    problem, n_periods = outcome_problem(seed), 5
    rng, model = np.random.default_rng(seed), problem.mdp.transitions
    table = Transitions(model, TRUTH).matrix.toarray().reshape(*model.available.shape, -1)
    features = rng.normal(size=(n_periods, *problem.features.shape))
    terminal = rng.normal(size=(problem.mdp.n_states, 2))
    wanted = backward_induction(problem, table, features, terminal)
    known = sc.from_transitions(table, problem.features, discount=0.9)
    for each, dynamics in ((problem, TRUTH), (known, None)):
        found = sc.finite_horizon(each, n_periods, features=features, terminal_features=terminal)
        policy = sc.soft_policy(found, WEIGHTS, dynamics).probabilities
        decided = policy[: -problem.mdp.n_states].reshape(wanted.shape)
        np.testing.assert_allclose(decided, wanted, atol=1e-10)
        assert np.all(found.mdp.final[-problem.mdp.n_states :])


def test_rewards_and_dynamics_are_learned_from_episodes_of_a_few_periods():
    problem, n_periods = outcome_problem(n_states=8), 4
    whole = sc.finite_horizon(problem, n_periods)
    start = np.zeros(whole.mdp.n_states)
    start[:8] = 1 / 8
    expert = sc.soft_policy(whole, WEIGHTS, TRUTH).probabilities
    rng = np.random.default_rng(3)
    sampled = sc.sample_decisions(
        whole.mdp, expert, TRUTH, start, n_episodes=1500, n_steps=n_periods, rng=rng
    )
    plain = sc.Decisions(
        sampled.episode, sampled.time_s, sampled.state % 8, sampled.action, sampled.next_state % 8
    )
    again = sc.decisions_in_periods(plain.select(rng.permutation(len(plain))), 8, n_periods)
    order = np.lexsort((again.time_s, again.episode))
    np.testing.assert_array_equal(again.state[order], sampled.state)
    np.testing.assert_array_equal(again.next_state[order], sampled.next_state)
    fit = sc.fit_mdce_serd(whole, again)
    assert fit.converged
    np.testing.assert_allclose(fit.reward_weights, WEIGHTS, atol=0.15)
    np.testing.assert_allclose(fit.outcome_probabilities, TRUTH, atol=0.03)


PROBLEM = outcome_problem()
TIMED = sc.semi_markov_problem(PROBLEM)
EPISODE = sc.decisions_from_episodes([([0, 1, 2], [0, 0])])


test_what_does_not_fit_is_rejected = refusals(
    (lambda: sc.finite_horizon(TIMED, 2), "known to get a finite horizon, got Semi"),
    (lambda: sc.finite_horizon(PROBLEM, 0), "n_periods must be a whole number of at least 1"),
    (lambda: sc.finite_horizon(PROBLEM, 10**15), "must fit into memory, but needs"),
    (lambda: sc.finite_horizon(PROBLEM, 2, features=PROBLEM.features), "features must have sh"),
    (lambda: sc.finite_horizon(PROBLEM, 2, terminal_features=np.zeros(3)), "l_features must h"),
    (lambda: sc.decisions_in_periods(EPISODE, 6, 1), r"period\[1\] must be one of 1 from 0"),
    (lambda: sc.decisions_in_periods(EPISODE, 2, 2), r"next_state\[1\] must be a state of the"),
)


def test_decisions_may_state_their_period():
    given = sc.decisions_in_periods(EPISODE, 6, 9, period=np.array([3, 4]))
    assert (given.state.tolist(), given.next_state.tolist()) == ([18, 25], [25, 32])


def test_a_final_state_goes_on_paying_for_the_one_action_it_has():
    table, features = np.zeros((3, 2, 3)), np.zeros((3, 2, 1))
    table[0, 0, 1] = table[0, 1, 2] = table[1, 0, 0] = table[1, 1, 2] = table[2, 1, 2] = 1.0
    features[0, 0], features[2, 1] = 0.3, 1.0
    problem = sc.from_transitions(table, features, discount=0.9)
    ended = sc.soft_policy(sc.finite_horizon(problem, 3), [2.0])
    value = np.array([0.0, 0.0, 2.0 / (1.0 - 0.9)])
    for _ in range(3):
        quality = features[:, :, 0] * 2.0 + 0.9 * table @ value
        value = logsumexp(np.where(problem.mdp.available, quality, -np.inf), axis=1)
    np.testing.assert_allclose(ended.value[:3], value, rtol=1e-12)
