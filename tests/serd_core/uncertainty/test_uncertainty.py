from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc
from serd_core.demonstrations.observations import observe
from serd_core.policies.solved_policy import MdcePolicy, PolicyMatchingPolicy
from serd_core.posterior.hessian import sensitivities_at, transition_scores
from serd_core.posterior.posterior import Posterior
from support.small_problems import apart, fit_of, sampled

PRECISE = sc.TrustRegion(gradient_tolerance=1e-9)


def fitted(case, weights=(1.0, 1.0), **options):
    found = fit_of(case, weights, **options)
    return found, sc.fit_information(case.problem, case.decisions, found)


def at_reward(fit, reward):
    return replace(fit, parameters=fit.parameters.with_block(sc.Block.REWARD, np.array(reward)))


def test_the_error_of_an_observed_outcome_is_that_of_a_proportion(minimum_example):
    """With the reward held fixed the transitions of a are coin flips: sqrt(p (1 - p) / n)."""
    action = [0] * 100 + [0, 1] * 30
    both = apart(0, action, [1] * 30 + [0] * 70 + [0, 1, 1, 0] * 15)
    given = {"belief": sc.FreeBelief(), "prior": sc.KldPrior(1e-9), "initial_weights": np.zeros(1)}
    fit = sc.fit_mdce_serd(minimum_example, both, ascent=sc.TrustRegion(max_steps=100), **given)
    information = sc.fit_information(minimum_example, both, fit)
    errors = sc.standard_errors(minimum_example, information, information.outer_product)
    share = fit.outcome_probabilities[0, 1]
    assert share == pytest.approx(45 / 130, abs=1e-5)
    expected = np.sqrt(share * (1 - share) / 130)
    np.testing.assert_allclose(errors.outcome_probabilities[0], expected, rtol=1e-4)


@pytest.mark.parametrize("policy_model", [MdcePolicy(), PolicyMatchingPolicy(1.3)], ids=repr)
def test_scores_add_up_to_the_gradient_of_the_likelihood(gridworld, policy_model):
    problem, rng = gridworld.problem, np.random.default_rng(0)
    seen = observe(problem, gridworld.decisions)
    posterior = Posterior(problem, seen, policy_model, sc.UniformPrior())
    at = fit_of(gridworld, (1.0, 1.0), ascent=sc.TrustRegion(max_steps=2)).parameters
    at = at.with_vector(at.vector + 0.1 * rng.normal(size=92))
    at = replace(at, policy=policy_model.initial_parameters)
    found = posterior.evaluate(at)
    scores = transition_scores(posterior, at, found, sensitivities_at(posterior, at, found))
    np.testing.assert_allclose(seen.group_count @ scores, found.gradient.vector, atol=1e-6)
    assert seen.group_count.sum() == len(gridworld.decisions)


def test_hessian_and_outer_product_agree_for_many_decisions_of_a_true_model(make_gridworld):
    case = make_gridworld(side=4, n_episodes=1)
    table = np.clip(case.probabilities, 0.05, None)
    table /= table.sum(axis=1, keepdims=True)
    policy = sc.soft_policy(case.problem, case.weights, table).probabilities
    case = replace(case, decisions=sampled(case.problem, policy, table, 4000, 30))
    fit, information = fitted(case, ascent=sc.TrustRegion())
    by_hessian = sc.standard_errors(case.problem, information)
    by_scores = sc.standard_errors(case.problem, information, information.outer_product)
    np.testing.assert_allclose(by_hessian.reward, by_scores.reward, rtol=0.05)
    np.testing.assert_allclose(
        by_hessian.outcome_probabilities, by_scores.outcome_probabilities, rtol=0.15
    )
    low, high = by_hessian.reward_interval(fit.reward_weights, 0.999)
    assert np.all((low <= case.weights) & (case.weights <= high))
    width = (high - low) / by_hessian.reward
    np.testing.assert_allclose(width, 2 * 3.290527, rtol=1e-6)
    assert sc.identifiability(information).identified


def test_an_action_never_taken_and_its_reward_cannot_be_told_apart(minimum_example):
    """The minimum example: one likelihood, many explanations."""
    decisions = apart(0, 0, [1] * 20 + [0] * 10)
    start = {"initial_weights": [0.5], "prior": sc.KldPrior(1.0)}
    fit = sc.fit_mdce_serd(minimum_example, decisions, **start)
    information = sc.fit_information(minimum_example, decisions, fit)
    diagnosis = sc.identifiability(information)
    assert not diagnosis.identified
    named = " ".join(str(direction) for direction in diagnosis.null)
    assert "reward state" in named
    assert "dynamics model 1 outcome" in named
    errors = sc.standard_errors(minimum_example, information, information.outer_product)
    assert np.isinf(errors.reward[0])
    assert np.all(np.isinf(errors.outcome_probabilities[1]))


def test_points_that_are_no_maximum_have_no_standard_errors_unless_asked_for(gridworld):
    """From weights of the wrong sign J bends upwards along some direction after one step."""
    problem, decisions = gridworld.problem, gridworld.decisions
    _, information = fitted(gridworld, [-8.0, 8.0], ascent=sc.TrustRegion(max_steps=1))
    with pytest.raises(sc.SerdError, match="must not have negative eigenvalues"):
        sc.standard_errors(problem, information)
    known = {"belief": sc.FixedBelief(), "ascent": sc.TrustRegion(max_steps=1)}
    _, information = fitted(gridworld, [6.0, 8.0], **known)
    for matrix in (information.observed, information.outer_product):
        with pytest.raises(sc.SerdError, match=r"must have converged .* got not converged and"):
            sc.standard_errors(problem, information, matrix)
        there = sc.standard_errors(problem, information, matrix, require_optimum=False)
        assert np.all(np.isfinite(there.reward))
    # Half a standard error off, in a fit that claims to have converged.
    fit, information = fitted(gridworld, belief=sc.FixedBelief(), ascent=PRECISE)
    away = np.array([sc.standard_errors(problem, information).reward[0], 0.0])
    moved = at_reward(fit, fit.reward_weights + 0.5 * away)
    with pytest.raises(sc.SerdError, match=r"got converged and 0.[3-9]"):
        sc.standard_errors(problem, sc.fit_information(problem, decisions, moved))
    moved = at_reward(fit, fit.reward_weights + 0.01 * away)
    there = sc.standard_errors(problem, sc.fit_information(problem, decisions, moved))
    assert np.all(np.isfinite(there.reward))


def test_units_of_features_change_the_errors_by_their_factor_only(gridworld):
    """Metres or kilometres: exactly the same fit, in other units."""
    problem, decisions = gridworld.problem, gridworld.decisions
    fit, one = fitted(gridworld, prior=sc.KldPrior(1.0), ascent=PRECISE)
    units = np.array([1e-5, 1e3])
    rescaled = replace(problem, features=problem.features * units)
    other = sc.fit_information(rescaled, decisions, at_reward(fit, fit.reward_weights / units))
    for name in ("observed", "outer_product"):
        errors, scaled = (
            sc.standard_errors(problem, found, getattr(found, name)) for found in (one, other)
        )
        assert np.all(np.isfinite(errors.reward))
        np.testing.assert_allclose(scaled.reward, errors.reward / units, rtol=1e-6)
        np.testing.assert_allclose(
            scaled.outcome_probabilities, errors.outcome_probabilities, rtol=1e-5, atol=1e-12
        )
    first, second = sc.identifiability(one), sc.identifiability(other)
    assert list(map(str, first.null)) == list(map(str, second.null))
    np.testing.assert_allclose(second.eigenvalues, first.eigenvalues, atol=1e-9)


def fit_from_zero(problem, decisions, fit=sc.fit_mdce_irl_by_likelihood, **options):
    start = np.zeros(len(problem.feature_names))
    return fit(problem, decisions, initial_weights=start, **options)


def informed(problem, decisions, **options):
    return sc.fit_information(problem, decisions, fit_from_zero(problem, decisions, **options))


#: One state, two actions: the choice is a logit of the weight.
BANDIT = sc.from_transitions(np.ones((1, 2, 1)), np.array([[[1.0], [0.0]]]), discount=0.5)


def choices(actions, episode=None):
    number = np.arange(len(actions))
    zeros = np.zeros_like(number)
    return sc.Decisions(number if episode is None else episode, number, zeros, actions, zeros)


def test_the_error_of_a_logit_is_its_closed_form():
    """Scores are 1 - p and -p, so both information matrices and the sandwich are n p (1 - p)."""
    information = informed(BANDIT, choices([0] * 30 + [1] * 70))
    outer = information.outer_product
    for matrix, meat in ((information.observed, None), (outer, None), (None, outer)):
        errors = sc.standard_errors(BANDIT, information, matrix, meat=meat)
        assert errors.reward[0] == pytest.approx(1 / np.sqrt(100 * 0.3 * 0.7), rel=1e-6)
        assert errors.free[0] == pytest.approx(np.sqrt(errors.covariance[0, 0]))


def random_case(seed, scale=1.0):
    rng = np.random.default_rng(seed)
    table, features = rng.dirichlet(np.ones(5), size=(5, 3)), scale * rng.normal(size=(5, 3, 2))
    problem = sc.from_transitions(table, features, discount=0.9)
    policy = sc.soft_policy(problem, np.array([1.0, -0.7]) / scale).probabilities
    return problem, sc.sample_decisions(problem.mdp, policy, n_episodes=40, n_steps=10, rng=rng)


LEARNERS = [sc.fit_mdce_irl_by_likelihood, sc.fit_mdce_irl_by_entropy]
LEARNERS += [sc.fit_maxent_irl, sc.fit_policy_matching]


def test_policy_matching_alone_does_not_determine_the_scale_of_rewards():
    problem, decisions = random_case(0)
    held = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)
    for prior, known in ((sc.UniformPrior(), False), (held, True)):
        information = informed(problem, decisions, fit=sc.fit_pm_serd, prior=prior)
        errors = sc.standard_errors(problem, information).reward
        assert np.isfinite(errors).all() if known else np.isinf(errors).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("fit", LEARNERS)
def test_units_of_features_change_no_fit(fit, scale):
    (problem, decisions), (other, same) = random_case(1), random_case(1, scale)
    wanted, found = fit_from_zero(problem, decisions, fit=fit), fit_from_zero(other, same, fit=fit)
    assert found.converged, found.message
    np.testing.assert_allclose(found.reward_weights * scale, wanted.reward_weights, atol=1e-3)
