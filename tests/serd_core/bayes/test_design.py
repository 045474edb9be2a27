import numpy as np
import pytest

from serd_core.bayes.design import expected_information_gain
from serd_core.bayes.laplace import laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.selection.evaluation import fitted_policy
from serd_core.uncertainty.information import fit_information

PROPER = GaussianPrior(2.0, Block.REWARD) + DirichletPrior(0.7)


def test_one_decision_of_a_logistic_model_with_counted_outcomes():
    """gain = 1/2 log(1 + s_w pi (1 - pi)) + 1/2 log(1 + s_u p (1 - p) |D|^2), by hand."""
    successors = np.zeros((2, 2, 2), int)
    successors[0], successors[1] = [0, 1], 1
    models = OutcomeModels(successors, np.zeros((2, 2), int), np.ones((2, 2), bool), 1)
    features = np.array([[[1.0], [0.0]], [[0.0], [0.0]]])
    problem = TabularProblem(Mdp(models, 0.0), features, ("first",))
    actions = np.repeat([0, 1], [9, 4])
    decisions = Decisions(
        np.arange(13), np.zeros(13), np.zeros(13, int), actions, np.arange(13) % 3 // 2
    )
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
    sampled = sample_decisions(
        problem.mdp,
        fitted_policy(problem, fit),
        fit.outcome_probabilities,
        np.eye(problem.mdp.n_states)[start],
        n_episodes=n_episodes,
        n_steps=length,
        rng=np.random.default_rng(0),
    )
    outer = fit_information(problem, sampled, fit).outer_product / n_episodes
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


def test_states_that_end_an_episode_teach_nothing(absorbing_problem):
    problem, decisions = absorbing_problem
    fit = fit_mdce_serd(problem, decisions)
    gain = expected_information_gain(laplace(problem, decisions, fit))
    final = problem.mdp.final
    assert final.any()
    np.testing.assert_array_equal(gain[final], 0.0)
    assert np.all(gain[~final] > 0)


@pytest.fixture
def absorbing_problem():
    """A line of five cells; the last ends the episode."""
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
    decisions = sample_decisions(
        problem.mdp,
        np.array([[0.2, 0.8]] * 4 + [[1.0, 0.0]]),
        np.array([[0.9, 0.1]]),
        np.eye(5)[0],
        n_episodes=5,
        n_steps=30,
        rng=np.random.default_rng(0),
    )
    return problem, decisions


def test_another_goal_is_another_task(absorbing_problem):
    problem, decisions = absorbing_problem
    fit = fit_mdce_serd(problem, decisions)
    found = laplace(problem, decisions, fit)
    nearer = problem.features.copy()
    nearer[3] = 1.0
    task = TabularProblem(problem.mdp, nearer, problem.feature_names)
    ours, theirs = expected_information_gain(found), expected_information_gain(found, task=task)
    assert not np.allclose(ours, theirs)
    np.testing.assert_array_equal(ours, expected_information_gain(found, task=problem))


def test_a_task_of_other_features_or_models_is_rejected(absorbing_problem):
    problem, decisions = absorbing_problem
    found = laplace(problem, decisions, fit_mdce_serd(problem, decisions))
    renamed = TabularProblem(problem.mdp, problem.features, ("other",))
    with pytest.raises(SerdError, match=r"must have the features of the fit \('goal',\)"):
        expected_information_gain(found, task=renamed)
    models = problem.mdp.transitions
    more = OutcomeModels(models.successors, models.model_of, models.available, 2)
    larger = TabularProblem(Mdp(more, 0.9), problem.features, problem.feature_names)
    with pytest.raises(SerdError, match=r"outcome models of the fit, 2 energies, got 4"):
        expected_information_gain(found, task=larger)
    with pytest.raises(SerdError, match=r"longest must be at least 1 decision, got 0"):
        expected_information_gain(found, longest=0)
