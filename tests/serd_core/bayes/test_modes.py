import numpy as np
import pytest

from serd_core.bayes.draws import laplace_draws, posterior_modes
from serd_core.bayes.laplace import laplace
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from support.small_problems import apart

GIVEN = PriorByEvidence(deviation=3.0, pseudo_count=1.0)


def test_both_explanations_of_the_minimum_example_have_their_weight(minimum_example):
    """Section 4.6.1; the weights are those of a grid over all three numbers."""
    always_a = apart(0, 0, [0, 1, 1] * 10)
    fit = fit_mdce_serd(minimum_example, always_a, prior=GIVEN)
    modes = posterior_modes(minimum_example, always_a, fit, np.random.default_rng(0))
    assert len(modes.approximations) == 2
    positive = sum(
        weight
        for one, weight in zip(modes.approximations, modes.weights, strict=True)
        if one.mode[0] > 0
    )
    axes = [np.linspace(-13, 13, 14), np.linspace(-3.5, 3.5, 10), np.linspace(-6, 6, 11)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    density = np.exp([modes.objective.evaluate(u)[0] - fit.objective for u in grid])
    exact = density[grid[:, 0] > 0].sum() / density.sum()
    assert positive == pytest.approx(exact, abs=0.05)
    draws = modes.draws(minimum_example, np.random.default_rng(1), 400)
    assert np.mean(draws.reward[:, 0] > 0) == pytest.approx(positive, abs=0.08)
    assert modes.log_evidence > laplace(minimum_example, always_a, fit).log_evidence - 1e-9


def test_too_few_starts_are_rejected(counted):
    problem, decisions = counted
    fit = fit_mdce_serd(problem, decisions, prior=GIVEN)
    with pytest.raises(SerdError, match="n_starts must be a whole number of at least 1, got 0"):
        posterior_modes(problem, decisions, fit, np.random.default_rng(0), n_starts=0)
    with pytest.raises(SerdError, match=r"rng must be a .*Generator, got 3"):
        posterior_modes(problem, decisions, fit, 3)
    with pytest.raises(SerdError, match=r"rng must be a .*Generator, got 3"):
        laplace_draws(laplace(problem, decisions, fit), 3)
