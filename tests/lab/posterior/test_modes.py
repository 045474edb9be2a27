"""The maxima of a posterior and their weights."""

import numpy as np
import pytest

import serd_core as sc
from lab.posterior.modes import posterior_modes
from support.small_problems import apart, minimum_example_problem

GIVEN = sc.PriorByEvidence(deviation=3.0, pseudo_count=1.0)


def test_both_explanations_of_the_minimum_example_have_their_weight():
    """Section 4.6.1; the weights are those of a grid over all three numbers."""
    problem, always_a = minimum_example_problem(0.9), apart(0, 0, [0, 1, 1] * 10)
    fit = sc.fit_mdce_serd(problem, always_a, prior=GIVEN)
    found = sc.laplace(problem, always_a, fit)
    modes = posterior_modes(problem, always_a, fit, np.random.default_rng(0), 6)
    assert len(modes.approximations) == 2
    pairs = zip(modes.approximations, modes.weights, strict=True)
    positive = sum(weight for one, weight in pairs if one.mode[0] > 0)
    axes = [np.linspace(-13, 13, 14), np.linspace(-3.5, 3.5, 10), np.linspace(-6, 6, 11)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    density = np.exp([modes.objective.evaluate(u)[0] - fit.objective for u in grid])
    exact = density[grid[:, 0] > 0].sum() / density.sum()
    assert positive == pytest.approx(exact, abs=0.05)
    draws = modes.draws(problem, np.random.default_rng(1), 400)
    assert np.mean(draws.reward[:, 0] > 0) == pytest.approx(positive, abs=0.08)
    assert modes.log_evidence > found.log_evidence - 1e-9
    with pytest.raises(sc.SerdError, match="n_starts must be a whole number of at least 1, got 0"):
        posterior_modes(problem, always_a, fit, np.random.default_rng(0), n_starts=0)
    with pytest.raises(sc.SerdError, match=r"rng must be a .*Generator, got 3"):
        posterior_modes(problem, always_a, fit, 3)
