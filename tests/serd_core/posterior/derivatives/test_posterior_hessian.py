import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_core.demonstrations.observations import observe
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior.beliefs import CoupledBelief, FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.derivatives import posterior_hessian
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.gaussian import GaussianPrior
from support.random_posteriors import (
    random_parameters,
    uniform_decisions,
)

BELIEFS = [TiedBelief(), FreeBelief(), CoupledBelief(weight=0.7), FixedBelief()]


def test_the_sum_over_states_does_not_depend_on_its_chunks(random_problem, monkeypatch):
    posterior, parameters = posterior_of(random_problem)
    found = posterior.evaluate(parameters)
    whole = posterior_hessian.posterior_hessian(posterior, parameters, found)
    monkeypatch.setattr(posterior_hessian, "CHUNK", 1)
    in_chunks = posterior_hessian.posterior_hessian(posterior, parameters, found)
    np.testing.assert_allclose(in_chunks, whole, rtol=1e-12, atol=1e-12)


def test_derivatives_by_rewards_do_not_depend_on_those_by_dynamics(random_problem):
    posterior, parameters = posterior_of(random_problem)
    found, reward = posterior.evaluate(parameters), parameters.place(Block.REWARD)
    whole = posterior_hessian.posterior_hessian(posterior, parameters, found)
    alone = posterior_hessian.posterior_hessian(posterior, parameters, found, learns_dynamics=False)
    np.testing.assert_allclose(alone[reward, reward], whole[reward, reward], rtol=1e-12)


@given(sizes=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=50))
def test_states_that_are_left_out_are_lost_in_rounding_together(sizes):
    given = np.array(sizes) ** 20
    kept = posterior_hessian.with_weight(given)
    assert given[~kept].sum() <= posterior_hessian.EPSILON * given.sum()
    assert given[kept].min(initial=np.inf) >= given[~kept].max(initial=0.0)


def posterior_of(random_problem):
    problem, table = random_problem(3)
    rng = np.random.default_rng(3)
    observations = observe(problem.mdp, uniform_decisions(problem, table, rng))
    prior = KldPrior(0.3, reference=table) + GaussianPrior(2.0, Block.REWARD)
    posterior = Posterior(problem, observations, MdcePolicy(), prior)
    return posterior, random_parameters(problem, MdcePolicy(), rng)


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
def test_pulling_back_is_multiplying_by_the_jacobian(belief):
    rng = np.random.default_rng(0)
    at = Parameters(rng.normal(size=2), rng.normal(size=3), rng.normal(size=3), np.array([1.7]))
    gradient = at.with_vector(rng.normal(size=9))
    np.testing.assert_allclose(
        belief.pull_back(gradient, at), belief.jacobian(at).T @ gradient.vector
    )
