"""Several goals share their weights: one goal is an ordinary fit, many are a sum."""

from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from serd_core.grid.grid import Grid
from serd_core.learners.several_goals import SumOverGoals, _log_likelihood

TRUTH = np.array([-1.0, -2.0])


def slippery(goal, side=5, seed=0):
    """A grid with an absorbing goal; steps cost, dark cells more. Slips are known."""
    grid = Grid(origin_m=(0, 0), cell_size_m=1.0, walkable=np.ones((side, side), bool))
    n, rng = grid.n_states, np.random.default_rng(seed)
    dark = rng.random(n) < 0.4
    table = np.zeros((n, 5, n))
    for action in range(5):
        chance = np.full(5, 0.05)
        chance[action] = 0.8
        for k in range(5):
            np.add.at(table[:, action], (np.arange(n), grid.neighbours[:, k]), chance[k])
    features = np.stack([np.ones(n), dark], axis=1)
    features[goal] = 0.0
    return sc.from_transitions(
        table, features, discount=0.98, feature_names=("step", "dark"), terminal=[goal]
    )


def simulated(goals=(0, 12, 24), n_episodes=60, seed=0):
    rng, pairs = np.random.default_rng(seed), []
    for goal in goals:
        problem = slippery(goal)
        policy = sc.soft_policy(problem, TRUTH).probabilities
        decisions = sc.sample_decisions(
            problem.mdp, policy, n_episodes=n_episodes, n_steps=60, rng=rng
        )
        pairs.append((problem, decisions))
    return pairs


def test_one_goal_is_an_ordinary_fit():
    (pair,) = simulated(goals=(12,))
    found = sc.fit_several_goals([pair])
    fit = sc.fit_mdce_irl_by_likelihood(*pair, initial_weights=np.zeros(2))
    assert found.converged
    np.testing.assert_allclose(found.reward_weights, fit.reward_weights, rtol=1e-5)
    assert found.log_likelihoods[0] == pytest.approx(fit.policy_log_likelihood, rel=1e-9)
    errors = sc.standard_errors(pair[0], sc.fit_information(*pair, fit))
    np.testing.assert_allclose(found.standard_errors, errors.reward, rtol=1e-4)


def test_steps_show_the_log_likelihood_of_the_choices_alone():
    (pair,), steps = simulated(goals=(12,)), []
    found = sc.fit_several_goals([pair], on_step=lambda step: steps.append(step.objective))
    assert steps[-1] == pytest.approx(found.log_likelihoods[0], rel=1e-9)


def test_the_gradient_over_all_goals_is_that_of_differences():
    pairs = simulated()
    objective = SumOverGoals([_log_likelihood(*pair, None) for pair in pairs])
    at, step = np.array([-0.7, -1.1]), 1e-5
    gradient, hessian = objective.evaluate(at)[1], objective.hessian(at)
    for f, unit in enumerate(step * np.eye(2)):
        above, below = objective.evaluate(at + unit), objective.evaluate(at - unit)
        assert (above[0] - below[0]) / (2 * step) == pytest.approx(gradient[f], rel=1e-6)
        np.testing.assert_allclose((above[1] - below[1]) / (2 * step), hessian[f], rtol=1e-5)


def test_weights_of_all_goals_together_are_nearer_the_truth_than_their_errors_allow_for_one():
    pairs = simulated()
    found = sc.fit_several_goals(pairs)
    assert np.all(np.abs(found.reward_weights - TRUTH) < 3.5 * found.standard_errors)
    single = sc.fit_several_goals(pairs[:1])
    assert np.all(found.standard_errors < single.standard_errors)
    assert found.n_decisions == sum(len(decisions) for _, decisions in pairs)


def test_collinear_features_have_infinite_errors():
    ((problem, decisions),) = simulated(goals=(12,))
    twice = replace(problem, features=problem.features[:, :, [0, 0]])
    found = sc.fit_several_goals([(twice, decisions)])
    np.testing.assert_array_equal(found.standard_errors, [np.inf, np.inf])


def test_goals_without_dynamics_or_with_other_features_are_rejected(gridworld):
    with pytest.raises(sc.SerdError, match="dynamics must be given for a model with 45 parameters"):
        sc.fit_several_goals([(gridworld.problem, gridworld.decisions)])
    with pytest.raises(sc.SerdError, match=r"goals must share their features \('step', 'dark'\)"):
        sc.fit_several_goals([*simulated((0,), 2), (gridworld.problem, gridworld.decisions)])
    with pytest.raises(sc.SerdError, match="goals must be at least one, got none"):
        sc.fit_several_goals([])
