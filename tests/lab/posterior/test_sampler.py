import importlib

import numpy as np
import pytest
import scipy.stats

from lab.posterior import sampler
from lab.posterior.modes import posterior_modes
from lab.posterior.sampler import sample_posterior
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.learners.serd import fit_mdce_serd
from serd_files.errors import USER_ERRORS

GIVEN = PriorByEvidence(deviation=3.0, pseudo_count=1.0)


def test_the_sampler_draws_from_a_known_posterior(counted):
    problem, decisions = counted
    fit = fit_mdce_serd(problem, decisions, prior=GIVEN)
    modes = posterior_modes(problem, decisions, fit, np.random.default_rng(0), n_starts=2)
    found = sample_posterior(problem, modes, np.random.default_rng(0), n_draws=400, n_warm_up=100)
    exact = scipy.stats.beta(10, 4)
    first = found.draws.outcome_probabilities[:, 0, 0]
    assert first.mean() == pytest.approx(exact.mean(), abs=0.02)
    for level in (0.1, 0.5, 0.9):
        assert np.quantile(first, level) == pytest.approx(exact.ppf(level), abs=0.03)
    # The weight of a constant feature keeps its prior.
    assert found.draws.reward.std() == pytest.approx(3.0, rel=0.15)
    assert found.r_hat <= 1.01
    assert found.n_effective >= 400


def test_chains_that_did_not_mix_are_no_result(counted):
    problem, decisions = counted
    fit = fit_mdce_serd(problem, decisions, prior=GIVEN)
    modes = posterior_modes(problem, decisions, fit, np.random.default_rng(0), n_starts=1)
    with pytest.raises(USER_ERRORS, match=r"chains must have mixed, with R-hat at most 1\.01, 400"):
        sample_posterior(problem, modes, np.random.default_rng(0), n_draws=8, n_warm_up=4)
    stuck = np.repeat(np.arange(4.0), 500).reshape(4, 500, 1)
    stuck = stuck + 0.01 * np.random.default_rng(0).normal(size=stuck.shape)
    with pytest.raises(USER_ERRORS, match="take more draws"):
        sampler._require_mixed(importlib.import_module("arviz"), stuck, np.zeros((4, 500)))
