from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from serd_core.arrays import gradient_differences
from serd_core.demonstrations.observations import observe
from serd_core.mixtures.expert_types import TIED, mixture_of, units_of
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.coordinates import coordinates
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.dirichlet import DirichletPrior
from serd_core.priors.gaussian import GaussianPrior
from support.random_posteriors import random_parameters

PRIORS = GaussianPrior(2.0, Block.REWARD), DirichletPrior(0.7)


@pytest.fixture(scope="module")
def mixed(make_mixed):
    return make_mixed(experts=4, episodes=1, side=3)


def objective_of(case, n_types=2, experts=None):
    """The log posterior of a mixture, and coordinates at random."""
    units = units_of(case.problem.mdp, case.decisions, experts)
    like = random_parameters(case.problem, MdcePolicy(), np.random.default_rng(3))
    space = coordinates(case.problem, TIED, like)
    objective = mixture_of(case.problem, units, PRIORS, space, n_types)
    return objective, vector_of(objective, 0)


def vector_of(objective, seed):
    return np.random.default_rng(seed).normal(size=objective.tables.shape[2])


def plain_posterior(case, decisions):
    prior = PRIORS[0] + PRIORS[1]
    return Posterior(case.problem, observe(case.problem.mdp, decisions), MdcePolicy(), prior)


@pytest.mark.parametrize("kind", ["observed", "m step"])
def test_gradient_and_hessian_are_finite_differences(mixed, kind):
    """Of the observed-data log posterior, and of an M step at fixed responsibilities."""
    objective, vector = objective_of(mixed, 3 if kind == "observed" else 2)
    if kind == "m step":
        responsibilities = objective.at(vector_of(objective, 5)).responsibilities
        objective = replace(objective, responsibilities=responsibilities, _last=None)
    gradient, hessian, step = objective.evaluate(vector)[1], objective.hessian(vector), 1e-5

    def slope(unit):
        near, far = (objective.evaluate(vector + k * step * unit)[0] for k in (1, 2))
        back, behind = (objective.evaluate(vector - k * step * unit)[0] for k in (1, 2))
        return (8 * (near - back) - (far - behind)) / (12 * step)

    numeric = np.array([slope(unit) for unit in np.eye(len(vector))])
    scale = np.abs(numeric).max()
    np.testing.assert_allclose(gradient / scale, numeric / scale, rtol=0, atol=1e-6)
    by_gradient = gradient_differences(lambda at: objective.evaluate(at)[1], vector)
    scale = np.abs(by_gradient).max()
    np.testing.assert_allclose(hessian / scale, by_gradient / scale, rtol=0, atol=3e-6)


def test_the_log_likelihood_is_that_of_each_expert_summed_over_types(mixed):
    objective, vector = objective_of(mixed, experts=mixed.experts // 2)
    at = objective.at(vector)
    for place, label in enumerate(objective.units.labels):
        own = mixed.decisions.select(mixed.experts // 2 == label)
        by_type = []
        for (_, parameters, _), log_share in zip(at.types, at.log_shares, strict=True):
            found = plain_posterior(mixed, own).evaluate(parameters)
            by_type.append(log_share + found.objective - found.log_prior)
        assert at.log_marginals[place] == pytest.approx(logsumexp(by_type), rel=1e-9)
        expected = np.exp(by_type - logsumexp(by_type))
        np.testing.assert_allclose(at.responsibilities[place], expected, atol=1e-9)
