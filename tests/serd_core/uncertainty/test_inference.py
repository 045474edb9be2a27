"""Standard errors by closed forms, and fits in other units."""

import numpy as np
import pytest

import serd_core as sc


def fitted(problem, decisions, fit=sc.fit_mdce_irl_by_likelihood, **options):
    start = np.zeros(len(problem.feature_names))
    return fit(problem, decisions, initial_weights=start, **options)


def informed(problem, decisions, **options):
    """The information of a fit from weights of 0."""
    return sc.fit_information(problem, decisions, fitted(problem, decisions, **options))


#: One state, two actions: the choice is a logit of the weight.
BANDIT = sc.from_transitions(np.ones((1, 2, 1)), np.array([[[1.0], [0.0]]]), discount=0.5)


def choices(actions):
    actions = np.asarray(actions)
    zeros = np.zeros(len(actions), int)
    return sc.Decisions(np.arange(len(actions)), zeros, zeros, actions, zeros)


def test_the_error_of_a_logit_is_its_closed_form():
    """Scores are 1 - p and -p, so both information matrices are n p (1 - p)."""
    information = informed(BANDIT, choices([0] * 30 + [1] * 70))
    for matrix in (information.observed, information.outer_product):
        errors = sc.standard_errors(BANDIT, information, matrix)
        assert errors.reward[0] == pytest.approx(1 / np.sqrt(100 * 0.3 * 0.7), rel=1e-6)


def random_problem(seed, scale=1.0):
    rng = np.random.default_rng(seed)
    table, features = rng.dirichlet(np.ones(5), size=(5, 3)), scale * rng.normal(size=(5, 3, 2))
    problem = sc.from_transitions(table, features, discount=0.9)
    policy = sc.soft_policy(problem, np.array([1.0, -0.7]) / scale).probabilities
    return problem, sc.sample_decisions(problem.mdp, policy, n_episodes=40, n_steps=10, rng=rng)


def test_policy_matching_alone_does_not_determine_the_scale_of_rewards():
    problem, decisions = random_problem(0)
    held = sc.GaussianPrior(0.1, sc.Block.POLICY, 1.0)
    for prior, known in ((sc.UniformPrior(), False), (held, True)):
        information = informed(problem, decisions, fit=sc.fit_pm_serd, prior=prior)
        errors = sc.standard_errors(problem, information).reward
        assert np.isfinite(errors).all() if known else np.isinf(errors).all()


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize(
    "fit",
    [
        sc.fit_mdce_irl_by_likelihood,
        sc.fit_mdce_irl_by_entropy,
        sc.fit_maxent_irl,
        sc.fit_policy_matching,
    ],
)
def test_units_of_features_change_no_fit(fit, scale):
    (problem, decisions), (other, same) = random_problem(1), random_problem(1, scale)
    wanted, found = fitted(problem, decisions, fit=fit), fitted(other, same, fit=fit)
    assert found.converged, found.message
    np.testing.assert_allclose(found.reward_weights * scale, wanted.reward_weights, atol=1e-3)
