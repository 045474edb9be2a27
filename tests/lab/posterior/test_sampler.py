import numpy as np
import pytest
import scipy.stats

from lab.posterior.modes import posterior_modes
from lab.posterior.sampler import sample_posterior
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.learners.serd import fit_mdce_serd

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
