"""Simulation-based calibration of posteriors (Talts et al., arXiv:1804.06788).

Parameters are drawn from the prior, decisions from them, and draws from the posterior of these. If
the posterior is right, the rank of the true value among L draws is uniform on 0, ..., L for every
number. A posterior that is too narrow gives ranks at both ends, one that is too wide in the middle.
"""

from collections.abc import Callable

import numpy as np
import scipy.stats

from serd_core.arrays import FloatArray, IntArray
from serd_core.bayes.laplace import PosteriorDraws, laplace, laplace_draws
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.estimation import outcome_models_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.coordinates import feature_ranges

#: Draws of the posterior of a problem, its decisions and its fit.
Draw = Callable[[Problem, Decisions, FitResult, np.random.Generator], PosteriorDraws]
#: Draws L that a rank is among; L + 1 has many divisors.
N_RANKED = 63
#: Probability that an outcome has at least, so that its logarithm is a number.
LEAST = 1e-9


def draw_by_laplace(
    problem: Problem, decisions: Decisions, fit: FitResult, rng: np.random.Generator
) -> PosteriorDraws:
    """Draws of Laplace's approximation; mirrored pairs are halved, as ranks need them apart."""
    draws = laplace_draws(laplace(problem, decisions, fit), rng, 2 * N_RANKED)
    return draws.select(slice(N_RANKED))


def calibration_ranks(
    problem: Problem,
    prior: PriorByEvidence,
    rng: np.random.Generator,
    *,
    n_data_sets: int,
    n_episodes: int,
    n_steps: int,
    draw: Draw = draw_by_laplace,
) -> IntArray:
    """(n_data_sets, F + M K) ranks of the true weights and outcome probabilities.

    prior: with both strengths given, as they are those of the true parameters. Episodes start
    anywhere.
    """
    if prior.deviation is None or prior.pseudo_count is None:
        raise SerdError(
            "prior must have a deviation and a pseudo_count, from which the truth is drawn, got"
            f" {prior}; pass numbers"
        )
    model = outcome_models_of(problem.mdp)
    starts = np.full(problem.mdp.n_states, 1.0 / problem.mdp.n_states)
    ranks = []
    for _ in range(n_data_sets):
        deviations = prior.deviation / feature_ranges(problem)
        weights = deviations * rng.standard_normal(len(deviations))
        counts = np.full(model.n_outcomes, prior.pseudo_count)
        table = np.maximum(rng.dirichlet(counts, model.n_models), LEAST)
        table /= table.sum(axis=1, keepdims=True)
        decisions = sample_decisions(
            problem.mdp,
            soft_policy(problem, weights, table).probabilities,
            table,
            starts,
            n_episodes=n_episodes,
            n_steps=n_steps,
            rng=rng,
        )
        found = draw(problem, decisions, fit_mdce_serd(problem, decisions, prior=prior), rng)
        below = [
            np.sum(found.reward < weights, axis=0),
            np.sum(found.outcome_probabilities < table, axis=0).ravel(),
        ]
        ranks.append(np.concatenate(below))
    return np.array(ranks, dtype=np.int64)


def uniformity(ranks: IntArray, n_draws: int = N_RANKED, n_bins: int = 8) -> FloatArray:
    """(n,) p-value of each number's ranks by the chi-squared test in bins of equal width."""
    bins = ranks * n_bins // (n_draws + 1)
    counts = np.stack([np.bincount(column, minlength=n_bins) for column in bins.T])
    return np.asarray(scipy.stats.chisquare(counts, axis=1).pvalue)
