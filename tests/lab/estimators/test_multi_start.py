from dataclasses import replace

import numpy as np
import pytest

from lab.estimators.multi_start import multi_start
from serd_core.demonstrations.decisions import Decisions
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior, KldPrior
from serd_core.priors.prior import GaussianPrior


@pytest.fixture
def always_a():
    """Thirty decisions for a, two thirds of which led on."""
    zeros = np.zeros(30, int)
    return Decisions(np.arange(30), zeros.astype(float), zeros, zeros, np.array([0, 1, 1] * 10))


def test_the_ambiguity_of_the_minimum_example_is_shown(minimum_example, always_a):
    """Both explanations of section 4.6.1: b leads on less often, or more often, than a."""
    prior = KldPrior(0.1) + GaussianPrior(2.0, Block.REWARD)
    found = multi_start(
        lambda rng: fit_mdce_serd(minimum_example, always_a, rng=rng, prior=prior),
        12,
        np.random.default_rng(0),
    )
    assert found.n_converged == 12
    assert len(found.explanations) == 2
    signs = {float(np.sign(one.fit.reward_weights[0])) for one in found.explanations}
    assert signs == {-1.0, 1.0}
    assert sorted(start for one in found.explanations for start in one.starts) == list(range(12))
    assert found.best.objective == max(fit.objective for fit in found.fits)


def test_the_open_scale_of_policy_matching_makes_no_second_explanation(minimum_example, always_a):
    """Rewards and temperature ten times as large choose alike."""
    prior = GaussianPrior(2.0, Block.REWARD) + GaussianPrior(0.1, Block.POLICY, 1.0)
    one = fit_pm_serd(
        minimum_example, always_a, initial_weights=np.ones(1), prior=prior + DirichletPrior(1.0)
    )
    ten_times = one.parameters.with_block(Block.REWARD, 10 * one.reward_weights)
    large = replace(one, parameters=ten_times, temperature=10 * one.temperature)
    other = replace(one, parameters=ten_times)
    assert len(multi_start(iter_of(one, large), 2, np.random.default_rng(0)).explanations) == 1
    assert len(multi_start(iter_of(one, other), 2, np.random.default_rng(0)).explanations) == 2


def iter_of(*fits):
    """A learner that returns these fits one after the other."""
    remaining = iter(fits)
    return lambda _: next(remaining)
