import numpy as np
import pytest

from serd_core.ascent.trust_region import TrustRegion
from serd_core.beliefs import FixedBelief, FreeBelief, TiedBelief
from serd_core.demonstrations import Decisions
from serd_core.errors import SerdError
from serd_core.learners.mdce_serd import fit_mdce_serd
from serd_core.learners.pm_serd import fit_pm_serd
from serd_core.likelihood.observations import observe
from serd_core.policies.mdce import MdcePolicy
from serd_core.policies.policy_matching import PolicyMatchingPolicy
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import UniformPrior
from serd_core.simulation import sample_decisions
from serd_core.solvers.newton import Newton
from serd_core.solvers.sparse_lu import SparseLu
from serd_core.uncertainty.identifiability import gauge_free_basis, identifiability
from serd_core.uncertainty.information import decision_scores, fit_information
from serd_core.uncertainty.standard_errors import (
    confidence_interval,
    probability_interval,
    standard_errors,
)

PRECISE = TrustRegion(gradient_tolerance=1e-9)


def coin(n_heads: int, n_tails: int) -> Decisions:
    following = np.array([1] * n_heads + [0] * n_tails)
    zeros = np.zeros(len(following), int)
    return Decisions(np.arange(len(following)), zeros.astype(float), zeros, zeros, following)


def test_the_error_of_an_observed_outcome_is_that_of_a_proportion(minimum_example):
    """With the reward held fixed the transitions of a are coin flips: sqrt(p (1 - p) / n)."""
    decisions = coin(30, 70)
    state, action = np.zeros(60, int), np.array([0, 1] * 30)
    zeros = np.zeros(160, int)
    both = Decisions(
        zeros,
        zeros.astype(float),
        np.concatenate([decisions.state, state]),
        np.concatenate([decisions.action, action]),
        np.concatenate([decisions.next_state, np.array([0, 1, 1, 0] * 15)]),
    )
    fit = fit_mdce_serd(
        minimum_example,
        both,
        initial_weights=np.zeros(1),
        belief=FreeBelief(),
        prior=KldPrior(1e-9),
        ascent=TrustRegion(max_steps=100),
    )
    information = fit_information(minimum_example, both, fit, belief=FreeBelief())
    errors = standard_errors(minimum_example, information, information.outer_product)
    share = fit.outcome_probabilities[0, 1]
    assert share == pytest.approx(45 / 130, abs=1e-5)
    expected = np.sqrt(share * (1 - share) / 130)
    np.testing.assert_allclose(errors.outcome_probabilities[0], expected, rtol=1e-4)


@pytest.mark.parametrize("policy_model", [MdcePolicy(), PolicyMatchingPolicy(1.3)], ids=repr)
def test_scores_add_up_to_the_gradient_of_the_likelihood(gridworld, policy_model):
    problem, rng = gridworld.problem, np.random.default_rng(0)
    posterior = Posterior(
        problem,
        observe(problem.mdp, gridworld.decisions),
        policy_model,
        UniformPrior(),
        Newton(),
        SparseLu(),
    )
    fit = fit_mdce_serd(
        problem, gridworld.decisions, initial_weights=np.ones(2), ascent=TrustRegion(max_steps=2)
    )
    at = fit.parameters.with_vector(fit.parameters.vector + 0.1 * rng.normal(size=92))
    parameters = type(at)(at.reward, at.belief, at.truth, policy_model.initial_parameters)
    found = posterior.evaluate(parameters)
    scores, counts = decision_scores(posterior, parameters, found, posterior.observations)
    np.testing.assert_allclose(counts @ scores, found.gradient.vector, atol=1e-6)
    assert counts.sum() == len(gridworld.decisions)


def test_hessian_and_outer_product_agree_for_many_decisions_of_a_true_model(make_gridworld):
    case = make_gridworld(side=4, n_episodes=1)
    table = np.clip(case.probabilities, 0.05, None)
    table /= table.sum(axis=1, keepdims=True)
    policy = soft_policy(case.problem, case.weights, table).probabilities
    decisions = sample_decisions(
        case.problem.mdp,
        policy,
        table,
        np.full(16, 1 / 16),
        n_episodes=4000,
        n_steps=30,
        rng=np.random.default_rng(0),
    )
    fit = fit_mdce_serd(case.problem, decisions, initial_weights=np.ones(2), ascent=TrustRegion())
    information = fit_information(case.problem, decisions, fit)
    by_hessian = standard_errors(case.problem, information, information.observed)
    by_scores = standard_errors(case.problem, information, information.outer_product)
    np.testing.assert_allclose(by_hessian.reward, by_scores.reward, rtol=0.05)
    np.testing.assert_allclose(
        by_hessian.outcome_probabilities, by_scores.outcome_probabilities, rtol=0.15
    )
    low, high = confidence_interval(fit.reward_weights, by_hessian.reward, 0.999)
    assert np.all((low <= case.weights) & (case.weights <= high))
    assert identifiability(information).identified


def test_errors_say_how_much_estimates_scatter(make_gridworld):
    """Monte Carlo: the spread of repeated estimates is the standard error."""
    case = make_gridworld(side=4, n_episodes=1)
    policy = soft_policy(case.problem, case.weights, case.probabilities).probabilities
    table = np.clip(case.probabilities, 1e-6, None)
    table /= table.sum(axis=1, keepdims=True)
    found, errors = [], []
    for seed in range(60):
        decisions = sample_decisions(
            case.problem.mdp,
            policy,
            case.probabilities,
            np.full(16, 1 / 16),
            n_episodes=60,
            n_steps=20,
            rng=np.random.default_rng(seed),
        )
        fit = fit_mdce_serd(
            case.problem,
            decisions,
            initial_weights=case.weights,
            initial_dynamics=table,
            belief=FixedBelief(),
            ascent=TrustRegion(),
        )
        information = fit_information(case.problem, decisions, fit, belief=FixedBelief())
        found.append(fit.reward_weights)
        errors.append(standard_errors(case.problem, information, information.observed).reward)
    np.testing.assert_allclose(np.std(found, axis=0), np.mean(errors, axis=0), rtol=0.25)


def test_an_action_never_taken_and_its_reward_cannot_be_told_apart(minimum_example):
    """The minimum example: one likelihood, many explanations."""
    decisions = coin(20, 10)
    fit = fit_mdce_serd(
        minimum_example, decisions, initial_weights=np.array([0.5]), prior=KldPrior(1.0)
    )
    information = fit_information(minimum_example, decisions, fit, prior=KldPrior(1.0))
    diagnosis = identifiability(information)
    assert not diagnosis.identified
    named = " ".join(str(direction) for direction in diagnosis.null)
    assert "reward state" in named
    assert "dynamics model 1 outcome" in named
    errors = standard_errors(minimum_example, information, information.outer_product)
    assert np.isinf(errors.reward[0])
    assert np.all(np.isinf(errors.outcome_probabilities[1]))


def test_a_prior_settles_what_the_data_leave_open(minimum_example):
    decisions = coin(20, 10)
    prior = KldPrior(1.0)
    fit = fit_mdce_serd(minimum_example, decisions, initial_weights=np.array([0.5]), prior=prior)
    information = fit_information(minimum_example, decisions, fit, prior=prior)
    with_prior = identifiability(information, matrix=information.observed)
    assert len(with_prior.null) < len(identifiability(information).null)


def test_temperature_and_scale_of_rewards_are_one_null_direction(gridworld):
    """Theta_P and theta_R of the policy-matching model share a common factor."""
    model = PolicyMatchingPolicy()
    fit = fit_pm_serd(
        gridworld.problem,
        gridworld.decisions,
        initial_weights=np.ones(2),
        belief=FixedBelief(),
        ascent=TrustRegion(max_steps=20),
    )
    information = fit_information(
        gridworld.problem, gridworld.decisions, fit, policy_model=model, belief=FixedBelief()
    )
    diagnosis = identifiability(information)
    assert len(diagnosis.null) == 1
    names = {name for name, _ in diagnosis.null[0].loadings}
    assert "log temperature" in names


def test_the_gauge_is_taken_out_of_tied_and_free_blocks(gridworld):
    fit = fit_mdce_serd(
        gridworld.problem,
        gridworld.decisions,
        initial_weights=np.ones(2),
        ascent=TrustRegion(max_steps=2),
    )
    for belief, n_free, n_gauge in ((TiedBelief(), 47, 9), (FreeBelief(), 92, 18)):
        information = fit_information(gridworld.problem, gridworld.decisions, fit, belief=belief)
        assert information.gauge.shape == (n_gauge, n_free)
        basis = gauge_free_basis(information)
        np.testing.assert_allclose(information.gauge @ basis, 0, atol=1e-12)
        np.testing.assert_allclose(basis.T @ basis, np.eye(n_free - n_gauge), atol=1e-12)
        np.testing.assert_allclose(information.outer_product @ information.gauge.T, 0, atol=1e-7)


def test_a_point_that_is_no_maximum_is_refused(gridworld):
    fit = fit_mdce_serd(
        gridworld.problem,
        gridworld.decisions,
        initial_weights=np.array([-8.0, 8.0]),
        ascent=TrustRegion(max_steps=1),
    )
    information = fit_information(gridworld.problem, gridworld.decisions, fit)
    with pytest.raises(SerdError, match="must not have negative eigenvalues"):
        standard_errors(gridworld.problem, information, -np.eye(47))
    with pytest.raises(SerdError, match="coverage must be between 0 and 1"):
        confidence_interval(np.zeros(1), np.ones(1), 2.0)


def test_an_interval_reaches_as_many_standard_errors_as_its_coverage_says():
    lower, upper = confidence_interval(np.array([1.0, 0.0]), np.array([2.0, np.inf]))
    np.testing.assert_allclose(lower, [1.0 - 1.959964 * 2.0, -np.inf], atol=1e-5)
    np.testing.assert_allclose(upper, [1.0 + 1.959964 * 2.0, np.inf], atol=1e-5)
    narrow, _ = confidence_interval(np.zeros(1), np.ones(1), coverage=0.6826895)
    np.testing.assert_allclose(narrow, [-1.0], atol=1e-6)
    with pytest.raises(SerdError, match="coverage must be between 0 and 1, got 95"):
        confidence_interval(np.zeros(1), np.ones(1), coverage=95)


def test_intervals_of_probabilities_stay_within_0_and_1():
    lower, upper = probability_interval(np.array([0.01, 0.5]), np.array([0.01, 0.1]))
    odds, width = np.log(0.01 / 0.99), 1.959964 * 0.01 / (0.01 * 0.99)
    assert lower[0] == pytest.approx(1 / (1 + np.exp(-(odds - width))), rel=1e-6)
    assert upper[0] == pytest.approx(1 / (1 + np.exp(-(odds + width))), rel=1e-6)
    assert lower[1] + upper[1] == pytest.approx(1.0)
    np.testing.assert_allclose(
        probability_interval(np.array([1.0, 0.0, 0.3, 0.0]), np.array([0.0, 0.0, np.inf, 0.1])),
        [[1, 0, 0, 0], [1, 0, 1, 1]],
    )


def test_intervals_of_probabilities_are_symmetric_ones_for_small_errors():
    share, error = np.linspace(0.05, 0.95, 19), np.full(19, 1e-5)
    for found, expected in zip(
        probability_interval(share, error), confidence_interval(share, error), strict=True
    ):
        np.testing.assert_allclose(found - share, expected - share, rtol=1e-3)


def test_an_interval_of_no_probability_is_refused():
    with pytest.raises(SerdError, match=r"estimate\[0\] must be a probability, got 1.5"):
        probability_interval(np.array([1.5]), np.array([0.1]))
    with pytest.raises(SerdError, match="coverage must be between 0 and 1, got 95"):
        probability_interval(np.array([0.5]), np.array([0.1]), coverage=95)
