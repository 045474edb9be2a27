import numpy as np

from serd_core.demonstrations.observations import observe
from serd_core.policies.policy_model import MdcePolicy
from serd_core.posterior import hessian as module
from serd_core.posterior.parameters import Block
from serd_core.posterior.posterior import Posterior
from serd_core.priors.divergence import KldPrior
from serd_core.priors.prior import GaussianPrior
from support.random_posteriors import random_parameters, uniform_decisions


def test_chunks_of_states_and_blocks_that_are_left_out_change_nothing(random_problem, monkeypatch):
    problem, table = random_problem(3)
    rng = np.random.default_rng(3)
    observations = observe(problem.mdp, uniform_decisions(problem, table, rng))
    prior = KldPrior(0.3, reference=table) + GaussianPrior(2.0, Block.REWARD)
    posterior = Posterior(problem, observations, MdcePolicy(), prior)
    parameters = random_parameters(problem, MdcePolicy(), rng)
    found, reward = posterior.evaluate(parameters), parameters.place(Block.REWARD)
    whole = module.posterior_hessian(posterior, parameters, found)
    alone = module.posterior_hessian(posterior, parameters, found, learns_dynamics=False)
    np.testing.assert_allclose(alone[reward, reward], whole[reward, reward], rtol=1e-12)
    monkeypatch.setattr(module, "CHUNK", 1)
    in_chunks = module.posterior_hessian(posterior, parameters, found)
    np.testing.assert_allclose(in_chunks, whole, rtol=1e-12, atol=1e-12)
