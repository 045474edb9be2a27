from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from serd_core.arrays import gradient_differences
from serd_core.demonstrations.observations import observe
from serd_core.mixtures.expert_types import expectation_maximisation
from serd_core.mixtures.mixture_posterior import TIED, mixture_of, units_of
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.coordinates import coordinates
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from tests.support.random_posteriors import random_parameters

PRIORS = GaussianPrior(2.0, Block.REWARD), DirichletPrior(0.7)


def objective_of(case, n_types=2, experts=None, decisions=None):
    found = case.decisions if decisions is None else decisions
    units = units_of(case.problem.mdp, found, experts)
    like = random_parameters(case.problem, MdcePolicy(), np.random.default_rng(3))
    return mixture_of(case.problem, units, PRIORS, coordinates(case.problem, TIED, like), n_types)


def vector_of(objective, seed=0):
    return np.random.default_rng(seed).normal(size=objective.tables.shape[2])


def plain_posterior(case, decisions):
    prior = PRIORS[0] + PRIORS[1]
    return Posterior(case.problem, observe(case.problem.mdp, decisions), MdcePolicy(), prior)


@pytest.mark.parametrize("hidden", [False, True], ids=["shown", "hidden"])
def test_gradient_and_hessian_are_those_of_the_observed_data_log_posterior(mixed, hidden):
    decisions = mixed.decisions
    if hidden:
        decisions = decisions.with_hidden_actions(decisions.episode % 2 == 0)
    objective = objective_of(mixed, 3, decisions=decisions)
    vector, step = vector_of(objective), 1e-5
    _, gradient = objective.evaluate(vector)

    def slope(unit):
        near, far = (objective.evaluate(vector + k * step * unit)[0] for k in (1, 2))
        back, behind = (objective.evaluate(vector - k * step * unit)[0] for k in (1, 2))
        return (8 * (near - back) - (far - behind)) / (12 * step)

    numeric = np.array([slope(unit) for unit in np.eye(len(vector))])
    scale = np.abs(numeric).max()
    np.testing.assert_allclose(gradient / scale, numeric / scale, rtol=0, atol=1e-6)
    hessian = objective.hessian(vector)
    by_gradient = gradient_differences(lambda at: objective.evaluate(at)[1], vector)
    scale = np.abs(by_gradient).max()
    np.testing.assert_allclose(hessian / scale, by_gradient / scale, rtol=0, atol=3e-6)


def test_the_derivatives_of_an_m_step_are_those_at_fixed_responsibilities(mixed):
    objective = objective_of(mixed)
    vector = vector_of(objective)
    responsibilities = objective.at(vector_of(objective, 5)).responsibilities
    expected = replace(objective, responsibilities=responsibilities, _last=None)
    _, gradient = expected.evaluate(vector)
    sides = [
        (expected.evaluate(vector + unit)[0], expected.evaluate(vector - unit)[0])
        for unit in 1e-5 * np.eye(len(vector))
    ]
    numeric = -np.diff(sides, axis=1).ravel() / 2e-5
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())
    by_gradient = gradient_differences(lambda at: expected.evaluate(at)[1], vector)
    scale = np.abs(by_gradient).max()
    np.testing.assert_allclose(expected.hessian(vector) / scale, by_gradient / scale, atol=3e-6)


@pytest.mark.parametrize("hidden", [False, True], ids=["shown", "hidden"])
def test_the_log_likelihood_is_that_of_each_expert_summed_over_types(mixed, hidden):
    decisions = mixed.decisions.with_hidden_actions() if hidden else mixed.decisions
    objective = objective_of(mixed, experts=mixed.experts // 2, decisions=decisions)
    at = objective.at(vector_of(objective))
    for place, label in enumerate(objective.units.labels):
        own = decisions.select(mixed.experts // 2 == label)
        by_type = []
        for (_, parameters, _), log_share in zip(at.types, at.log_shares, strict=True):
            found = plain_posterior(mixed, own).evaluate(parameters)
            by_type.append(log_share + found.objective - found.log_prior)
        assert at.log_marginals[place] == pytest.approx(logsumexp(by_type), rel=1e-9)
        np.testing.assert_allclose(
            at.responsibilities[place], np.exp(by_type - logsumexp(by_type)), atol=1e-9
        )


def test_one_type_has_the_log_posterior_of_a_plain_fit(mixed):
    objective = objective_of(mixed, n_types=1)
    vector = vector_of(objective)
    parameters = objective.at(vector).types[0][1]
    plain = plain_posterior(mixed, mixed.decisions).evaluate(parameters)
    assert objective.evaluate(vector)[0] == pytest.approx(plain.objective)


def test_the_order_of_types_changes_nothing_but_the_order(mixed):
    objective = objective_of(mixed, 3)
    vector, order = vector_of(objective), np.array([2, 0, 1])
    other = vector.copy()
    other[objective.rewards] = vector[objective.rewards[order]]
    energies = (objective.share_table @ vector)[order]
    other[:2] = objective.share_table[:, :2].T @ energies
    assert objective.evaluate(other)[0] == pytest.approx(objective.evaluate(vector)[0], rel=1e-12)
    moved, before = (objective.at(each).responsibilities for each in (other, vector))
    np.testing.assert_allclose(moved, before[:, order], atol=1e-9)


def test_no_step_of_em_lowers_the_log_posterior(mixed):
    objective = objective_of(mixed)
    for seed in range(3):
        values = [
            value for value, _ in expectation_maximisation(objective, vector_of(objective, seed))
        ]
        assert np.all(np.diff(values) >= 0)
        assert values[-1] > values[0]


def test_a_unit_that_counts_twice_counts_as_two_units(mixed):
    units = units_of(mixed.problem.mdp, mixed.decisions)
    twice = units.weighted(np.full(len(units.labels), 2.0))
    np.testing.assert_array_equal(twice.state_action, 2 * units.pooled.state_action)
    np.testing.assert_array_equal(twice.group_count, 2 * units.pooled.group_count)
    assert replace(twice, state_action=units.pooled.state_action).n_decisions == len(
        mixed.decisions
    )
