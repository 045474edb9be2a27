import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.bellman.linear.sparse_lu import SparseLu
from serd_core.bellman.newton import Newton
from serd_core.demonstrations.observations import observe
from serd_core.policies.policy_model import MdcePolicy, PolicyMatchingPolicy
from serd_core.posterior.beliefs import CoupledBelief, FixedBelief, FreeBelief, TiedBelief
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.entropy import EntropyPrior
from serd_core.priors.gaussian import GaussianPrior
from support.random_posteriors import (
    assert_hessian_is_of_the_gradient,
    assume_one_best_action_around,
    random_parameters,
    uniform_decisions,
)

BELIEFS = [TiedBelief(), FreeBelief(), CoupledBelief(weight=0.7), FixedBelief()]
POLICIES = [MdcePolicy(), PolicyMatchingPolicy(start_temperature=1.7)]


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
@pytest.mark.parametrize("policy_model", POLICIES, ids=lambda model: type(model).__name__)
@settings(deadline=None, max_examples=12)
@given(seed=st.integers(0, 10_000))
def test_the_hessian_is_the_finite_difference_of_the_gradient(
    random_problem, policy_model, belief, seed
):
    problem, table = random_problem(seed)
    rng = np.random.default_rng(seed)
    decisions = uniform_decisions(problem, table, rng)
    if not len(decisions):
        return
    prior = KldPrior(0.3, reference=table) + EntropyPrior(0.2, Block.BELIEF)
    prior = prior + GaussianPrior(2.0, Block.REWARD) + belief.prior
    posterior = Posterior(
        problem, observe(problem.mdp, decisions), policy_model, prior, Newton(), SparseLu()
    )
    like = random_parameters(problem, policy_model, rng)
    parameters = belief.unpack(belief.pack(like), like)
    if isinstance(policy_model, PolicyMatchingPolicy):
        assume_one_best_action_around(posterior, belief, parameters)
    assert_hessian_is_of_the_gradient(posterior, belief, parameters)


@pytest.mark.parametrize("belief", BELIEFS, ids=lambda belief: type(belief).__name__)
def test_pulling_back_is_multiplying_by_the_jacobian(belief):
    rng = np.random.default_rng(0)
    at = Parameters(rng.normal(size=2), rng.normal(size=3), rng.normal(size=3), np.array([1.7]))
    gradient = at.with_vector(rng.normal(size=9))
    np.testing.assert_allclose(
        belief.pull_back(gradient, at), belief.jacobian(at).T @ gradient.vector
    )
