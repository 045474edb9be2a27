"""Several starts."""

from dataclasses import replace

import numpy as np

from lab.estimators.multi_start import multi_start
from serd_core.learners.serd import fit_mdce_serd, fit_pm_serd
from serd_core.posterior.parameters import Block
from serd_core.priors.divergence import DirichletPrior, KldPrior
from serd_core.priors.prior import GaussianPrior
from support.small_problems import apart

#: Thirty decisions for a, two thirds of which led on.
ALWAYS_A = apart(0, 0, [0, 1, 1] * 10)


def test_the_ambiguity_of_the_minimum_example_is_shown(minimum_example):
    """Both explanations of section 4.6.1: b leads on less often, or more often, than a."""
    prior = KldPrior(0.1) + GaussianPrior(2.0, Block.REWARD)
    fit = lambda rng: fit_mdce_serd(minimum_example, ALWAYS_A, rng=rng, prior=prior)  # noqa: E731
    found = multi_start(fit, 12, np.random.default_rng(0))
    assert found.n_converged == 12
    assert len(found.explanations) == 2
    signs = {float(np.sign(one.fit.reward_weights[0])) for one in found.explanations}
    assert signs == {-1.0, 1.0}
    assert sorted(start for one in found.explanations for start in one.starts) == list(range(12))
    assert found.best.objective == max(fit.objective for fit in found.fits)


def test_the_open_scale_of_policy_matching_makes_no_second_explanation(minimum_example):
    """Rewards and temperature ten times as large choose alike."""
    prior = GaussianPrior(2.0, Block.REWARD) + GaussianPrior(0.1, Block.POLICY, 1.0)
    one = fit_pm_serd(
        minimum_example, ALWAYS_A, initial_weights=np.ones(1), prior=prior + DirichletPrior(1.0)
    )
    ten_times = one.parameters.with_block(Block.REWARD, 10 * one.reward_weights)
    large = replace(one, parameters=ten_times, temperature=10 * one.temperature)
    other = replace(one, parameters=ten_times)
    for fit, n_explanations in ((large, 1), (other, 2)):
        fits = iter((one, fit))
        found = multi_start(lambda _, fits=fits: next(fits), 2, np.random.default_rng(0))
        assert len(found.explanations) == n_explanations
