"""Problems over a number of periods, against backward induction."""

import numpy as np
import pytest
from scipy.special import logsumexp

import serd_core as sc
from serd_core.errors import SerdError
from serd_core.posterior.parameters import Parameters

WEIGHTS = np.array([1.5, -0.7])
TRUTH = np.array([[0.7, 0.2, 0.1], [0.1, 0.3, 0.6]])


def outcome_problem(seed: int = 0, n_states: int = 6):
    rng = np.random.default_rng(seed)
    available = rng.random((n_states, 3)) < 0.8
    available[:, 0] = True
    models = sc.OutcomeModels(
        rng.integers(n_states, size=(n_states, 3, 3)),
        rng.integers(2, size=(n_states, 3)),
        available,
        2,
    )
    features = rng.normal(size=(n_states, 3, 2))
    return sc.TabularProblem(sc.Mdp(models, 0.9), features, ("one", "two"))


def dense(problem, dynamics):
    """(S, A, S) transition probabilities of outcome models."""
    models = problem.mdp.transitions
    n_states, n_actions, n_outcomes = models.successors.shape
    table = np.zeros((n_states, n_actions, n_states))
    for s in range(n_states):
        for a in range(n_actions):
            for k in range(n_outcomes):
                probability = dynamics[models.model_of[s, a], k]
                table[s, a, models.successors[s, a, k]] += probability
    return table


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
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n_periods, *problem.features.shape))
    terminal = rng.normal(size=(problem.mdp.n_states, 2))
    found = sc.finite_horizon(problem, n_periods, features=features, terminal_features=terminal)
    policy = sc.soft_policy(found, WEIGHTS, TRUTH).probabilities
    wanted = backward_induction(problem, dense(problem, TRUTH), features, terminal)
    decided = policy[: -problem.mdp.n_states].reshape(wanted.shape)
    np.testing.assert_allclose(decided, wanted, atol=1e-10)
    assert np.all(found.mdp.final[-problem.mdp.n_states :])


def test_known_transitions_get_a_horizon_too():
    problem = outcome_problem()
    table = dense(problem, TRUTH)
    table[~problem.mdp.available] = 0.0
    known = sc.from_transitions(table, problem.features, discount=0.9)
    ended = sc.finite_horizon(known, 4)
    policies = [
        sc.soft_policy(each, WEIGHTS, dynamics).probabilities
        for each, dynamics in (
            (ended, None),
            (sc.finite_horizon(problem, 4), TRUTH),
        )
    ]
    np.testing.assert_allclose(policies[0], policies[1], atol=1e-10)


def test_parameters_of_a_sparse_model_are_shared_by_all_periods():
    """Two states; action 1 changes the state with the probability that is learned."""

    def entries(parameters):
        p = 1.0 / (1.0 + np.exp(-parameters[0]))
        return np.array([1.0, p, 1.0 - p, 1.0, p, 1.0 - p])

    def vector_jacobian(parameters, gradient):
        p = 1.0 / (1.0 + np.exp(-parameters[0]))
        return np.array([p * (1.0 - p) * (gradient @ np.array([0, 1, -1, 0, 1, -1]))])

    model = sc.SparseModel(
        n_pairs=(2, 2),
        state=np.array([0, 0, 0, 1, 1, 1]),
        action=np.array([0, 1, 1, 0, 1, 1]),
        next_state=np.array([0, 1, 0, 1, 0, 1]),
        parameter_count=1,
        probabilities=entries,
        vector_jacobian=vector_jacobian,
    )
    features = np.zeros((2, 2, 1))
    features[1] = 1.0
    problem = sc.finite_horizon(sc.TabularProblem(sc.Mdp(model, 0.9), features, ("in 1",)), 6)
    truth = problem.mdp.transitions.local_probabilities(np.array([0.8]))
    decisions = sc.sample_decisions(
        problem.mdp,
        sc.soft_policy(problem, [1.0], truth).probabilities,
        truth,
        np.eye(problem.mdp.n_states)[0],
        n_episodes=2000,
        n_steps=6,
        rng=np.random.default_rng(0),
    )
    fit = sc.fit_mdce_serd(
        problem, decisions, dynamics=np.array([0.0]), prior=sc.UniformPrior(), initial_weights=[0.0]
    )
    assert fit.converged
    assert fit.reward_weights[0] == pytest.approx(1.0, abs=0.1)
    assert fit.parameters.truth[0] == pytest.approx(0.8, abs=0.1)


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


def test_what_does_not_fit_is_rejected():
    problem = outcome_problem()
    with pytest.raises(SerdError, match="n_periods must be a whole number of at least 1, got 0"):
        sc.finite_horizon(problem, 0)
    with pytest.raises(SerdError, match="must fit into memory, but needs"):
        sc.finite_horizon(problem, 10**15)
    with pytest.raises(SerdError, match="features must have shape"):
        sc.finite_horizon(problem, 2, features=problem.features)
    with pytest.raises(SerdError, match="terminal_features must have shape"):
        sc.finite_horizon(problem, 2, terminal_features=np.zeros(3))
    decisions = sc.decisions_from_episodes([([0, 1, 2], [0, 0])])
    with pytest.raises(
        SerdError, match="must be in one of the 1 periods from 0 to 0, got period 1"
    ):
        sc.decisions_in_periods(decisions, 6, 1)
    with pytest.raises(SerdError, match="next_state of decision 1 must be one of the 2 states"):
        sc.decisions_in_periods(decisions, 2, 2)
    given = sc.decisions_in_periods(decisions, 6, 9, period=np.array([3, 4]))
    assert given.state.tolist() == [18, 25]
    assert given.next_state.tolist() == [25, 32]


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


def test_pseudo_counts_are_of_all_periods_together():
    rng = np.random.default_rng(0)
    table, features = rng.dirichlet(np.ones(3), size=(3, 2)), rng.normal(size=(3, 2, 1))
    problem = sc.from_transitions(table, features, discount=0.9, learned=True)
    known = sc.from_transitions(table, features, discount=0.9)
    policy = sc.soft_policy(known, [1.0]).probabilities
    decisions = sc.sample_decisions(known.mdp, policy, n_episodes=30, n_steps=4, rng=rng)
    several = sc.finite_horizon(problem, 4)
    moved = sc.decisions_in_periods(decisions, 3, 4)
    np.testing.assert_allclose(
        sc.estimate_dynamics(several, moved), sc.estimate_dynamics(problem, decisions), atol=1e-8
    )
    parameters = rng.normal(size=problem.mdp.transitions.n_parameters)
    at = Parameters(np.zeros(1), parameters, parameters, np.zeros(0))
    of_one, of_several = (
        sc.DirichletPrior(2.0).evaluate(each.mdp.transitions, at) for each in (problem, several)
    )
    assert of_several.value == pytest.approx(of_one.value)
    np.testing.assert_allclose(of_several.gradient.truth, of_one.gradient.truth, atol=1e-12)
    with pytest.raises(SerdError, match="one period to count transitions in, got 4"):
        sc.counted_transitions(several, moved)
