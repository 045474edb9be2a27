from dataclasses import replace

import numpy as np
import pytest

from serd_core.ascent.trust_region import TrustRegion
from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import observe
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.policy_model import MdcePolicy, PolicyMatchingPolicy
from serd_core.policies.solved_policy import boltzmann_policy, soft_policy
from serd_core.posterior.beliefs import FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.derivatives.posterior_hessian import sensitivities_at, transition_scores
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from serd_core.priors.prior import UniformPrior
from serd_core.uncertainty.identifiability import gauge_free_basis, identifiability
from serd_core.uncertainty.information import fit_information
from serd_core.uncertainty.standard_errors import (
    confidence_interval,
    standard_errors,
)
from support.small_problems import apart, sampled

PRECISE = TrustRegion(gradient_tolerance=1e-9)


def fitted(case, weights=(1.0, 1.0), fit=fit_mdce_serd, **options):
    """A fit from weights, and its information."""
    found = fit(case.problem, case.decisions, initial_weights=np.array(weights), **options)
    return found, fit_information(case.problem, case.decisions, found)


def test_the_error_of_an_observed_outcome_is_that_of_a_proportion(minimum_example):
    """With the reward held fixed the transitions of a are coin flips: sqrt(p (1 - p) / n)."""
    action = [0] * 100 + [0, 1] * 30
    both = apart(0, action, [1] * 30 + [0] * 70 + [0, 1, 1, 0] * 15)
    fit = fit_mdce_serd(
        minimum_example,
        both,
        initial_weights=np.zeros(1),
        belief=FreeBelief(),
        prior=KldPrior(1e-9),
        ascent=TrustRegion(max_steps=100),
    )
    information = fit_information(minimum_example, both, fit)
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
    fit, _ = fitted(gridworld, ascent=TrustRegion(max_steps=2))
    at = fit.parameters.with_vector(fit.parameters.vector + 0.1 * rng.normal(size=92))
    parameters = type(at)(at.reward, at.belief, at.truth, policy_model.initial_parameters)
    found = posterior.evaluate(parameters)
    slopes = sensitivities_at(posterior, parameters, found)
    scores = transition_scores(posterior, parameters, found, slopes)
    counts = posterior.observations.group_count
    np.testing.assert_allclose(counts @ scores, found.gradient.vector, atol=1e-6)
    assert counts.sum() == len(gridworld.decisions)


def test_hessian_and_outer_product_agree_for_many_decisions_of_a_true_model(make_gridworld):
    case = make_gridworld(side=4, n_episodes=1)
    table = np.clip(case.probabilities, 0.05, None)
    table /= table.sum(axis=1, keepdims=True)
    policy = soft_policy(case.problem, case.weights, table).probabilities
    case = replace(case, decisions=sampled(case.problem, policy, table, 4000, 30))
    fit, information = fitted(case, ascent=TrustRegion())
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
    case = make_gridworld(side=3, n_episodes=1)
    policy = soft_policy(case.problem, case.weights, case.probabilities).probabilities
    table = np.clip(case.probabilities, 1e-6, None)
    table /= table.sum(axis=1, keepdims=True)
    found, errors = [], []
    for seed in range(60):
        decisions = sampled(case.problem, policy, case.probabilities, 60, 20, seed)
        known = {"dynamics": table, "belief": FixedBelief(), "prior": UniformPrior()}
        fit, information = fitted(replace(case, decisions=decisions), case.weights, **known)
        found.append(fit.reward_weights)
        errors.append(standard_errors(case.problem, information, information.observed).reward)
    np.testing.assert_allclose(np.std(found, axis=0), np.mean(errors, axis=0), rtol=0.25)


def test_an_action_never_taken_and_its_reward_cannot_be_told_apart(minimum_example):
    """The minimum example: one likelihood, many explanations."""
    decisions = apart(0, 0, [1] * 20 + [0] * 10)
    fit = fit_mdce_serd(
        minimum_example, decisions, initial_weights=np.array([0.5]), prior=KldPrior(1.0)
    )
    information = fit_information(minimum_example, decisions, fit)
    diagnosis = identifiability(information)
    assert not diagnosis.identified
    named = " ".join(str(direction) for direction in diagnosis.null)
    assert "reward state" in named
    assert "dynamics model 1 outcome" in named
    errors = standard_errors(minimum_example, information, information.outer_product)
    assert np.isinf(errors.reward[0])
    assert np.all(np.isinf(errors.outcome_probabilities[1]))
    with_prior = identifiability(information, matrix=information.observed)
    assert len(with_prior.null) < len(diagnosis.null)


def test_temperature_and_scale_of_rewards_are_one_null_direction(gridworld):
    """Theta_P and theta_R of the policy-matching model share a common factor."""
    known = {"belief": FixedBelief(), "ascent": TrustRegion(max_steps=20)}
    _, information = fitted(gridworld, fit=fit_pm_serd, **known)
    diagnosis = identifiability(information)
    assert len(diagnosis.null) == 1
    names = {name for name, _ in diagnosis.null[0].loadings}
    assert "log temperature" in names


def test_the_gauge_is_taken_out_of_tied_and_free_blocks(gridworld):
    fit, _ = fitted(gridworld, ascent=TrustRegion(max_steps=2))
    for belief, n_free, n_gauge in ((TiedBelief(), 47, 9), (FreeBelief(), 92, 18)):
        information = fit_information(gridworld.problem, gridworld.decisions, fit, belief=belief)
        assert information.gauge.shape == (n_gauge, n_free)
        basis = gauge_free_basis(information.gauge)
        np.testing.assert_allclose(information.gauge @ basis, 0, atol=1e-12)
        np.testing.assert_allclose(basis.T @ basis, np.eye(n_free - n_gauge), atol=1e-12)
        np.testing.assert_allclose(information.outer_product @ information.gauge.T, 0, atol=1e-7)


def test_a_point_that_is_no_maximum_is_refused(gridworld):
    """One step from weights of the wrong sign J bends upwards along some direction."""
    _, information = fitted(gridworld, [-8.0, 8.0], ascent=TrustRegion(max_steps=1))
    with pytest.raises(SerdError, match="must not have negative eigenvalues"):
        standard_errors(gridworld.problem, information, information.observed)


def test_a_fit_on_its_way_has_no_standard_errors_unless_asked_for(gridworld):
    known = {"belief": FixedBelief(), "ascent": TrustRegion(max_steps=1)}
    _, information = fitted(gridworld, [6.0, 8.0], **known)
    for matrix in (information.observed, information.outer_product):
        with pytest.raises(SerdError, match=r"must have converged .* got not converged and"):
            standard_errors(gridworld.problem, information, matrix)
        there = standard_errors(gridworld.problem, information, matrix, require_optimum=False)
        assert np.all(np.isfinite(there.reward))


def test_a_point_away_from_the_optimum_is_refused_whatever_the_fit_says(gridworld):
    """Half a standard error off, in a fit that claims to have converged."""
    problem, decisions = gridworld.problem, gridworld.decisions
    fit, information = fitted(gridworld, belief=FixedBelief(), ascent=PRECISE)
    errors = standard_errors(problem, information, information.observed)
    for share, refused in ((0.01, False), (0.5, True)):
        at = fit.parameters
        reward = at.reward + share * np.array([errors.reward[0], 0.0])
        moved = replace(fit, parameters=Parameters(reward, at.belief, at.truth, at.policy))
        there = fit_information(problem, decisions, moved)
        if refused:
            with pytest.raises(SerdError, match=r"got converged and 0.[3-9]"):
                standard_errors(problem, there, there.observed)
        else:
            assert np.all(np.isfinite(standard_errors(problem, there, there.observed).reward))


def test_a_kink_has_no_standard_errors(make_gridworld):
    """Policy matching ends where two actions are equally good; gradients differ on both sides."""
    case = make_gridworld(side=8, discount=0.99, n_episodes=1)
    policy = boltzmann_policy(case.problem, case.weights, case.probabilities, 2.0).probabilities
    case = replace(case, decisions=sampled(case.problem, policy, case.probabilities, 2, 30, 2))
    prior = KldPrior(0.1) + GaussianPrior(0.1, Block.POLICY, mean=1.0)
    fit, information = fitted(case, fit=fit_pm_serd, prior=prior)
    assert fit.converged
    assert np.abs(information.gradient).max() / len(case.decisions) > 1e-3
    with pytest.raises(SerdError, match=r"negative eigenvalues|at a kink of the objective"):
        standard_errors(case.problem, information, information.observed)


def test_units_of_features_change_the_errors_by_their_factor_only(gridworld):
    """Metres or kilometres: exactly the same fit, in other units."""
    problem, decisions = gridworld.problem, gridworld.decisions
    fit, one = fitted(gridworld, prior=KldPrior(1.0), ascent=PRECISE)
    units = np.array([1e-5, 1e3])
    rescaled = TabularProblem(problem.mdp, problem.features * units, problem.feature_names)
    at = fit.parameters
    rescaled_fit = replace(
        fit, parameters=Parameters(at.reward / units, at.belief, at.truth, at.policy)
    )
    other = fit_information(rescaled, decisions, rescaled_fit)
    for name in ("observed", "outer_product"):
        errors, scaled = (
            standard_errors(problem, found, getattr(found, name)) for found in (one, other)
        )
        assert np.all(np.isfinite(errors.reward))
        np.testing.assert_allclose(scaled.reward, errors.reward / units, rtol=1e-6)
        np.testing.assert_allclose(
            scaled.outcome_probabilities, errors.outcome_probabilities, rtol=1e-5, atol=1e-12
        )
    for found in (identifiability(one), identifiability(other)):
        assert [str(null) for null in found.null] == [
            str(null) for null in identifiability(one).null
        ]
    np.testing.assert_allclose(
        identifiability(other).eigenvalues, identifiability(one).eigenvalues, atol=1e-9
    )


def test_what_a_fit_assumed_comes_with_it(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    known = {"belief": FixedBelief(), "ascent": TrustRegion(max_steps=20)}
    prior = GaussianPrior(0.1, Block.POLICY, 1.0)
    fit, information = fitted(gridworld, fit=fit_pm_serd, prior=prior, **known)
    assert len(information.names) == 3
    with pytest.raises(SerdError, match=r"fit must have 0 temperatures .* got 1; pass"):
        fit_information(problem, decisions, fit, policy_model=MdcePolicy())
    with pytest.raises(SerdError, match="must be given for a fit that does not record"):
        fit_information(problem, decisions, replace(fit, assumptions=None))
    other = TabularProblem(problem.mdp, problem.features[:, :, :1], ("goal",))
    with pytest.raises(SerdError, match=r"fit must have 1 reward weights .* got 2; pass"):
        fit_information(other, decisions, fit)


def test_the_belief_has_errors_of_its_own(gridworld):
    prior = KldPrior(1.0) + KldPrior(5.0, block=Block.BELIEF)
    for belief, same in ((TiedBelief(), True), (FreeBelief(), False)):
        _, information = fitted(gridworld, belief=belief, prior=prior, ascent=PRECISE)
        errors = standard_errors(gridworld.problem, information, information.observed)
        believed, true = errors.believed_outcome_probabilities, errors.outcome_probabilities
        assert believed.shape == true.shape
        assert np.allclose(believed, true) == same


def test_an_interval_reaches_as_many_standard_errors_as_its_coverage_says():
    lower, upper = confidence_interval(np.array([1.0, 0.0]), np.array([2.0, np.inf]))
    np.testing.assert_allclose(lower, [1.0 - 1.959964 * 2.0, -np.inf], atol=1e-5)
    np.testing.assert_allclose(upper, [1.0 + 1.959964 * 2.0, np.inf], atol=1e-5)
    narrow, _ = confidence_interval(np.zeros(1), np.ones(1), coverage=0.6826895)
    np.testing.assert_allclose(narrow, [-1.0], atol=1e-6)
    for estimate, errors, coverage, sentence in (
        ([0.0], [1.0], 95, "coverage must be between 0 and 1, got 95"),
        ([0.0, 0.0], [1.0, -2.0], 0.9, r"^errors\[1\] must be at least 0, got -2.0; give standard"),
        ([0.0, 0.0], [1.0], 0.9, r"errors must have the shape of estimate, \(2,\), got \(1,\)"),
        (["a"], [1.0], 0.9, "^estimate must be an array of numbers, got <U1"),
    ):
        with pytest.raises(SerdError, match=sentence):
            confidence_interval(estimate, errors, coverage)
