import numpy as np
import pytest
import scipy.integrate
import scipy.stats

from serd_core.bayes.information import outcome_information
from serd_core.bayes.laplace import laplace
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem
from serd_core.posterior.beliefs import FreeBelief
from serd_core.posterior.parameters import Block
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from support.small_problems import PROPER, apart, fit_of

C = 0.7


def two_ways(discount: float, n_models: int = 3, features: int = 1) -> TabularProblem:
    """Two ways lead from state 0 to state 1, where the first feature is 1.

    Each way has a model of two outcomes, arrive or stay; the third model is used nowhere. The
    second feature is 1 where the second way is taken.
    """
    successors = np.zeros((2, 2, 2), int)
    successors[0] = [[1, 0], [1, 0]]
    successors[1] = 1
    model_of = np.array([[0, 1], [0, 0]])
    available = np.array([[True, True], [True, False]])
    models = OutcomeModels(successors, model_of, available, n_models=n_models)
    table = np.zeros((2, 2, 2))
    table[1, :, 0] = 1.0
    table[0, 1, 1] = 1.0
    return TabularProblem(
        Mdp(models, discount), table[:, :, :features], ("goal", "second")[:features]
    )


def known(problem, decisions, **options):
    fit = fit_mdce_serd(
        problem, decisions, initial_weights=np.ones(len(problem.feature_names)), prior=PROPER
    )
    return fit, outcome_information(laplace(problem, decisions, fit), **options)


def test_without_a_future_only_counts_inform_by_the_divergence_of_beta_distributions():
    fit, found = known(two_ways(0.0), apart(0, 0, np.arange(12) < 9))
    assert fit.converged
    after, before = scipy.stats.beta(9 + C, 3 + C), scipy.stats.beta(C, C)

    def integrand(p: float) -> float:
        return after.pdf(p) * (after.logpdf(p) - before.logpdf(p))

    divergence = scipy.integrate.quad(integrand, 0, 1)[0]
    np.testing.assert_allclose(found.from_transitions, [divergence, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.from_choices, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.shared, 0.0, atol=1e-9)
    np.testing.assert_array_equal(found.n_decisions, [12, 0, 0])
    assert [found.source(m) for m in range(3)] == ["counts", "prior only", "prior only"]


def test_a_way_that_is_avoided_is_known_from_choices_alone():
    fit, found = known(two_ways(0.95), apart(0, 0, np.arange(40) < 20))
    assert fit.reward_weights[0] > 0
    assert found.from_transitions[1] == 0.0
    assert found.from_choices[1] > 0.1
    assert found.source(1) == "choices"
    assert found.source(2) == "prior only"
    assert found.median[1, 0] < 0.4 < found.median[0, 0]


def test_a_feature_that_explains_the_same_takes_the_information_and_is_named():
    decisions = apart(0, 0, np.arange(40) < 20)
    alone = known(two_ways(0.95), decisions)[1]
    problem = two_ways(0.95, features=2)
    both = known(problem, decisions)[1]
    assert both.from_choices[1] < 0.7 * alone.from_choices[1]
    assert both.shared[1] > alone.shared[1]
    assert problem.feature_names[both.partner[1]] == "second"


def test_information_does_not_depend_on_the_scale_of_features():
    problem, decisions = two_ways(0.95, features=2), apart(0, 0, np.arange(20) < 15)
    other = TabularProblem(problem.mdp, problem.features * [1e5, 1e-4], problem.feature_names)
    ours, theirs = (
        outcome_information(laplace(each, decisions, fit_mdce_serd(each, decisions)))
        for each in (problem, other)
    )
    for name in ("from_transitions", "from_choices", "shared", "lower", "upper"):
        found, expected = getattr(ours, name), getattr(theirs, name)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-9)


def test_choices_by_a_belief_of_its_own_say_nothing_of_the_truth():
    problem, decisions = two_ways(0.95), apart(0, 0, np.arange(30) < 20)
    prior = PROPER + DirichletPrior(C, Block.BELIEF)
    fit = fit_mdce_serd(
        problem, decisions, initial_weights=np.ones(1), belief=FreeBelief(), prior=prior
    )
    found = outcome_information(laplace(problem, decisions, fit))
    np.testing.assert_allclose(found.from_choices, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.shared, 0.0, atol=1e-9)


def test_intervals_hold_the_mass_they_state_and_widen_with_it():
    problem, decisions = two_ways(0.0), apart(0, 0, np.arange(200) < 150)
    _, narrow = known(problem, decisions, mass=0.5)
    _, wide = known(problem, decisions, mass=0.95)
    exact = scipy.stats.beta(150 + C, 50 + C)
    place = (0, 0)
    for found, mass in ((narrow, 0.5), (wide, 0.95)):
        assert exact.cdf(found.upper[place]) - exact.cdf(found.lower[place]) == pytest.approx(
            mass, abs=0.03
        )
        assert found.median[place] == pytest.approx(exact.median(), abs=0.01)


def test_where_all_outcomes_lead_to_one_state_nothing_is_learned_of_them():
    """Where both outcomes lead to one state, counts inform about neither."""
    models = OutcomeModels(
        np.array([[[1, 1]], [[1, 1]]]), np.zeros((2, 1), int), np.ones((2, 1), bool), 1
    )
    features = np.array([[[1.0]], [[0.0]]])
    problem = TabularProblem(Mdp(models, 0.9), features, ("one",))
    found = known(problem, apart(0, 0, np.ones(5, int)))[1]
    np.testing.assert_allclose(found.median, 0.5, atol=0.02)
    np.testing.assert_allclose(found.from_choices, 0.0, atol=1e-6)


def test_a_fit_of_rewards_alone_is_rejected(gridworld):
    prior = GaussianPrior(2.0, Block.REWARD)
    fit = fit_of(
        gridworld,
        [0.0, 0.0],
        fit=fit_mdce_irl_by_likelihood,
        dynamics=gridworld.probabilities,
        prior=prior,
    )
    with pytest.raises(SerdError, match=r"must have learned outcome models, got one of rewards"):
        outcome_information(laplace(gridworld.problem, gridworld.decisions, fit))
