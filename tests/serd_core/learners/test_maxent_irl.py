from itertools import product

import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.simulation import feature_counts, trajectories_of
from serd_core.dynamics.transition_model import Transitions, transitions_of
from serd_core.learners.maxent_irl import TrajectoryModel
from support.small_problems import sampled


def model_of(problem, table):
    return TrajectoryModel(problem, transitions_of(problem.mdp.transitions, table))


def brute_force(problem, table, weights, start, length):
    """Naive twin: enumerate all trajectories; gives log Z and expected features."""
    mdp = problem.mdp
    dense = Transitions(mdp.transitions, table).matrix.toarray()
    dense = dense.reshape(mdp.n_states, mdp.n_actions, mdp.n_states)
    total, features = 0.0, np.zeros(problem.features.shape[2])
    for actions in product(range(mdp.n_actions), repeat=length):
        for states in product(range(mdp.n_states), repeat=length):
            path = (start, *states)
            if not all(mdp.available[s, a] for s, a in zip(path[:-1], actions, strict=True)):
                continue
            steps = list(zip(path[:-1], actions, path[1:], strict=True))
            chance = np.prod([dense[s, a, following] for s, a, following in steps])
            phi = sum(mdp.discount**t * problem.features[s, a] for t, (s, a, _) in enumerate(steps))
            if mdp.absorbing[path[-1]]:
                only = mdp.available[path[-1]].argmax()
                tail = mdp.discount**length / (1 - mdp.discount)
                phi = phi + tail * problem.features[path[-1], only]
            total += chance * np.exp(weights @ phi)
            features += chance * np.exp(weights @ phi) * phi
    return np.log(total), features / total


@pytest.mark.parametrize("length", [1, 3])
@pytest.mark.parametrize("start", [0, 1])
def test_the_recursion_sums_over_all_trajectories(minimum_example, start, length):
    table, weights = np.array([[0.3, 0.7], [0.8, 0.2]]), np.array([0.4])
    model = model_of(minimum_example, table)
    log_z, expected = model.partition(weights, np.eye(2)[start], length)
    naive_log_z, naive_features = brute_force(minimum_example, table, weights, start, length)
    assert log_z == pytest.approx(naive_log_z)
    np.testing.assert_allclose(expected, naive_features)


def forked_problem(listed):
    """From 0 action A leads to 1, which cannot reach the goal 3, and B to 2; 4 is a bandit.

    listed: whether the impossible step from 1 to 3 is an entry of probability 0 or none.
    """
    pairs = [(0, 0, 1), (0, 1, 2), (1, 0, 1), (1, 0, 3), (2, 0, 2), (3, 0, 3), (4, 0, 2), (4, 1, 2)]
    probability = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    kept = probability >= (0.0 if listed else 1.0)
    model = sc.fixed_transitions((5, 2), *np.array(pairs)[kept].T, probability[kept])
    features = np.zeros((5, 2, 2))
    features[3, :, 0], features[4, 0, 0], features[0, 0, 1] = 1.0, 0.1, 1.0
    return sc.TabularProblem(sc.Mdp(model, 0.99), features, ("goal", "A"))


def test_a_transition_of_probability_zero_counts_as_little_as_one_that_is_not_listed():
    """The bandit asks for log(73 / 27) / 0.1; a goal worth 995 must not be reached by 1e-300.

    40 episodes from 0, half of them by A; 100 from 4, 73 of them by the first action.
    """
    rows = [(0, 0, 1, 1, 0, 1), (0, 1, 2, 2, 0, 2)] * 20
    rows += [(4, 0, 2, 2, 0, 2)] * 73 + [(4, 1, 2, 2, 0, 2)] * 27
    episode = np.repeat(np.arange(len(rows)), 2)
    steps = np.array(rows).reshape(-1, 3).T
    decisions = sc.Decisions(episode, np.tile([0.0, 1.0], len(rows)), *steps)
    one, two = (
        sc.fit_maxent_irl(forked_problem(listed), decisions, initial_weights=np.zeros(2))
        for listed in (True, False)
    )
    assert one.converged
    np.testing.assert_array_equal(one.reward_weights, two.reward_weights)
    np.testing.assert_allclose(one.reward_weights, [np.log(73 / 27) / 0.1, 0.0], atol=1e-3)


@pytest.mark.parametrize("certain", [False, True])
def test_at_the_optimum_the_model_expects_the_features_of_the_demonstrations(gridworld, certain):
    """(3.22), with a partition function for each length of episodes."""
    problem, decisions, table = gridworld.problem, gridworld.decisions, gridworld.probabilities
    if certain:
        table = np.eye(5)[[0, 1, 2, 3, 4, 1, 2, 3, 4]]
        policy = sc.soft_policy(problem, gridworld.weights, table).probabilities
        decisions = sampled(problem, policy, table, 40, 12)
    fit = sc.fit_maxent_irl(problem, decisions, initial_weights=np.zeros(2), dynamics=table)
    assert fit.converged
    episodes = trajectories_of(decisions)
    starts = np.bincount(episodes.start, minlength=25) / len(episodes)
    (length,) = np.unique(episodes.length)
    model = model_of(problem, table)
    expected = model.partition(fit.reward_weights, starts, int(length))[1]
    wanted = feature_counts(problem, decisions).mean(axis=0)
    np.testing.assert_allclose(expected, wanted, atol=1e-5)
