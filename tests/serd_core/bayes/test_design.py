from dataclasses import replace

import numpy as np
import pytest

from serd_core.bayes.information import expected_information_gain
from serd_core.bayes.laplace import laplace
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.selection.evaluation import fitted_policy
from serd_core.uncertainty.information import fit_information
from support.small_problems import PROPER, one_choice, sampled


def test_one_decision_of_a_logistic_model_with_counted_outcomes():
    """gain = 1/2 log(1 + s_w pi (1 - pi)) + 1/2 log(1 + s_u p (1 - p) |D|^2), by hand."""
    problem, decisions = one_choice(9, 4)
    fit = fit_mdce_serd(problem, decisions, initial_weights=np.zeros(1), prior=PROPER)
    found = laplace(problem, decisions, fit)

    taken = 1.0 / (1.0 + np.exp(-fit.reward_weights[0]))
    arrived = fit.outcome_probabilities[0, 0]
    by_weight = found.covariance[0, 0] * taken * (1.0 - taken)
    energies = found.covariance[1:, 1:]
    apart = np.array([1.0, -1.0])
    by_outcome = apart @ energies @ apart * arrived * (1.0 - arrived)
    expected = 0.5 * np.log1p(by_weight) + 0.5 * np.log1p(by_outcome)
    gain = expected_information_gain(found, longest=1)
    assert gain[0] == pytest.approx(expected, rel=1e-9)
    # The other state has no outcome to learn, and actions of equal reward show the weight is 0.
    assert gain[1] == pytest.approx(0.0, abs=1e-12)


def test_it_is_the_information_of_sampled_demonstrations(make_gridworld):
    """A naive twin: the outer product of scores of many demonstrations from one cell."""
    case = make_gridworld(side=3, n_episodes=10, n_steps=8)
    problem, start, length = case.problem, 4, 6
    fit = fit_mdce_serd(problem, case.decisions, initial_weights=np.ones(2), prior=PROPER)
    found = laplace(problem, case.decisions, fit)
    n_episodes = 4000
    policy, table = fitted_policy(problem, fit), fit.outcome_probabilities
    drawn = sampled(problem, policy, table, n_episodes, length, 0, np.eye(9)[start])
    outer = fit_information(problem, drawn, fit).outer_product / n_episodes
    root = found.coordinates.table @ found.root
    added = root.T @ outer @ root
    expected = 0.5 * np.linalg.slogdet(np.eye(len(added)) + added)[1]
    gain = expected_information_gain(found, longest=length)
    assert gain[start] == pytest.approx(expected, rel=0.02)


def test_longer_demonstrations_teach_more_and_a_goal_nothing(make_gridworld):
    case = make_gridworld(side=3, n_episodes=10)
    fit = fit_mdce_serd(case.problem, case.decisions)
    found = laplace(case.problem, case.decisions, fit)
    short, long = (expected_information_gain(found, longest=n) for n in (2, 10))
    assert np.all(long > short)


@pytest.fixture(scope="module")
def ended():
    """The posterior of a line of five cells, of which the last ends the episode."""
    cells = np.arange(5)
    successors = np.stack([np.maximum(cells - 1, 0), np.minimum(cells + 1, 4)], axis=1)
    successors = np.stack([successors, successors[:, ::-1]], axis=2)
    successors[4] = 4
    available = np.ones((5, 2), bool)
    available[4, 1] = False
    models = OutcomeModels(successors, np.zeros((5, 2), int), available, 1)
    features = np.zeros((5, 2, 1))
    features[4] = 1.0
    problem = TabularProblem(Mdp(models, 0.9), features, ("goal",))
    policy = np.array([[0.2, 0.8]] * 4 + [[1.0, 0.0]])
    decisions = sampled(problem, policy, np.array([[0.9, 0.1]]), 9, 30)
    return problem, laplace(problem, decisions, fit_mdce_serd(problem, decisions))


def test_states_that_end_an_episode_teach_nothing(ended):
    problem, found = ended
    gain, final = expected_information_gain(found), problem.mdp.final
    assert final.tolist() == [False] * 4 + [True]
    assert gain[4] == 0.0
    assert np.all(gain[:4] > 0)


def test_another_goal_is_another_task(ended):
    problem, found = ended
    nearer = problem.features.copy()
    nearer[3] = 1.0
    task = TabularProblem(problem.mdp, nearer, problem.feature_names)
    ours, theirs = expected_information_gain(found), expected_information_gain(found, task=task)
    assert not np.allclose(ours, theirs)
    np.testing.assert_array_equal(ours, expected_information_gain(found, task=problem))


def test_a_task_of_other_features_or_models_is_rejected(ended):
    problem, found = ended
    renamed = TabularProblem(problem.mdp, problem.features, ("other",))
    with pytest.raises(SerdError, match=r"must have the features of the fit \('goal',\)"):
        expected_information_gain(found, task=renamed)
    more = replace(problem.mdp.transitions, n_models=2)
    larger = TabularProblem(Mdp(more, 0.9), problem.features, problem.feature_names)
    with pytest.raises(SerdError, match=r"outcome models of the fit, 2 numbers, got 4"):
        expected_information_gain(found, task=larger)
    with pytest.raises(SerdError, match=r"longest must be at least 1 decision, got 0"):
        expected_information_gain(found, longest=0)
