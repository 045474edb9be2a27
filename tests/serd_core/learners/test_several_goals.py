"""Several goals share their weights: one goal is an ordinary fit, many are a sum."""

from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from serd_core.grid.grid import Grid
from serd_core.learners.several_goals import SumOverGoals, _log_likelihood

TRUTH = np.array([-1.0, -2.0])


def simulated(goals):
    """Drives to each absorbing goal of a 5 x 5 grid; steps cost, dark cells more, slips known."""
    grid, rng, pairs = Grid((0, 0), 1.0, np.ones((5, 5), bool)), np.random.default_rng(0), []
    dark, table = np.random.default_rng(0).random(25) < 0.4, np.zeros((25, 5, 25))
    for action, outcome in np.ndindex(5, 5):
        chance = 0.8 if action == outcome else 0.05
        np.add.at(table[:, action], (np.arange(25), grid.neighbours[:, outcome]), chance)
    for goal in goals:
        features = np.stack([np.ones(25), dark], axis=1)
        features[goal] = 0.0
        problem = sc.from_transitions(
            table, features, discount=0.98, feature_names=("step", "dark"), terminal=[goal]
        )
        policy = sc.soft_policy(problem, TRUTH).probabilities
        decisions = sc.sample_decisions(problem.mdp, policy, n_episodes=60, n_steps=60, rng=rng)
        pairs.append((problem, decisions))
    return pairs


def test_one_goal_is_an_ordinary_fit_and_collinear_features_have_infinite_errors():
    ((problem, decisions),), steps = simulated([12]), []
    found = sc.fit_several_goals([(problem, decisions)], on_step=steps.append)
    fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, initial_weights=np.zeros(2))
    assert found.converged
    np.testing.assert_allclose(found.reward_weights, fit.reward_weights, rtol=1e-5)
    assert found.log_likelihoods[0] == pytest.approx(fit.policy_log_likelihood, rel=1e-9)
    assert steps[-1].objective == pytest.approx(found.log_likelihoods[0], rel=1e-9)
    errors = sc.standard_errors(problem, sc.fit_information(problem, decisions, fit))
    np.testing.assert_allclose(found.standard_errors, errors.reward, rtol=1e-4)
    twice = replace(problem, features=problem.features[:, :, [0, 0]])
    found = sc.fit_several_goals([(twice, decisions)])
    np.testing.assert_array_equal(found.standard_errors, [np.inf, np.inf])


def test_many_goals_are_their_sum_and_nearer_the_truth_than_one():
    pairs = simulated([0, 12, 24])
    found, single = sc.fit_several_goals(pairs), sc.fit_several_goals(pairs[:1])
    assert np.all(np.abs(found.reward_weights - TRUTH) < 3.5 * found.standard_errors)
    assert np.all(found.standard_errors < single.standard_errors)
    assert found.n_decisions == sum(len(decisions) for _, decisions in pairs)
    objective = SumOverGoals([_log_likelihood(*pair, None) for pair in pairs])
    at = np.array([-0.7, -1.1])
    gradient, hessian = objective.evaluate(at)[1], objective.hessian(at)
    for f, step in enumerate(1e-5 * np.eye(2)):
        above, below = objective.evaluate(at + step), objective.evaluate(at - step)
        assert (above[0] - below[0]) / 2e-5 == pytest.approx(gradient[f], rel=1e-6)
        np.testing.assert_allclose((above[1] - below[1]) / 2e-5, hessian[f], rtol=1e-5)


def test_goals_without_dynamics_or_with_other_features_are_rejected(gridworld):
    pair = gridworld.problem, gridworld.decisions
    for goals, sentence in (
        ([pair], "dynamics must be given for a model with 45 parameters"),
        ([*simulated([0]), pair], r"goals must share their features \('step', 'dark'\)"),
        ([], "goals must be at least one, got none"),
        (pair, r"goals must list pairs .* pass \[\(problem,"),
    ):
        with pytest.raises(sc.SerdError, match=sentence):
            sc.fit_several_goals(goals)
