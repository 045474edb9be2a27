"""Simulation-based calibration of posteriors (Talts et al., arXiv:1804.06788).

Parameters are drawn from the prior, decisions from them, and draws from the posterior of these. If
the posterior is right, the rank of the true value among L draws is uniform on 0, ..., L for every
number. A posterior that is too narrow gives ranks at both ends, one that is too wide in the middle.
"""

from collections.abc import Callable

import numpy as np
import scipy.stats

from lab.posterior.families import Family
from serd_core.arrays import FloatArray, IntArray
from serd_core.bayes.hyperpriors import HYPERPRIORS, BaseMeasures
from serd_core.bayes.laplace import PosteriorDraws, draws_at, interval_draws, laplace
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions, sample_timed_decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.beliefs import TiedBelief
from serd_core.posterior.coordinates import coordinates, feature_ranges
from serd_core.priors.divergence import require_outcome_models
from serd_core.semi_markov.dwell_likelihood import WIDE, DwellPrior
from serd_core.semi_markov.models import SemiMarkovModels

#: Draws of the posterior of a problem, its decisions and its fit.
Draw = Callable[[Problem, Decisions, FitResult, np.random.Generator], PosteriorDraws]
#: Draws L that a rank is among; L + 1 has many divisors.
N_RANKED = 63
#: Probability that an outcome has at least, so that its logarithm is a number.
LEAST = 1e-280


def draw_by_sweeps(
    problem: Problem, decisions: Decisions, fit: FitResult, rng: np.random.Generator
) -> PosteriorDraws:
    """The last states of as many chains that have mixed, as far as chains for intervals do."""
    draws = interval_draws(laplace(problem, decisions, fit), rng)
    points = draws.coordinates[-N_RANKED:]
    return draws_at(problem, coordinates(problem, TiedBelief(), fit.parameters), points)


def calibration_ranks(
    family: Family, prior: PriorByEvidence, rng: np.random.Generator, draw: Draw = draw_by_sweeps
) -> IntArray:
    """(n,) ranks of the true weights, outcome probabilities, log means and log shapes of laws.

    prior: strengths that are not given are drawn as well.
    """
    problem = family.problem
    weights, truth = drawn_truth(problem, prior, rng)
    decisions = demonstrated(family, weights, truth, rng)
    found = draw(problem, decisions, fit_mdce_serd(problem, decisions, prior=prior), rng)
    models = require_outcome_models(problem.mdp.transitions, "calibration")
    below = [
        np.sum(found.reward < weights, axis=0),
        np.sum(
            models.local_probabilities(found.truth) < models.local_probabilities(truth), axis=0
        ).ravel(),
        np.sum(found.truth < truth, axis=0)[models.n_energies :],
    ]
    return np.concatenate(below)


def drawn_truth(
    problem: Problem, prior: PriorByEvidence, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """(F,) weights and (N,) parameters of the dynamics, drawn from a prior.

    Strengths of weights and outcomes that it does not give are drawn too, as in
    `serd_core.bayes.hyperpriors`.
    """
    assert prior.dwell_deviation is not None
    model = problem.mdp.transitions
    models = require_outcome_models(model, "calibration")
    n_features, ranges = len(problem.feature_names), feature_ranges(problem)
    scales = np.full(n_features, prior.deviation or _drawn("deviation", rng, n_features))
    weights = scales / ranges * rng.standard_normal(n_features)
    base = BaseMeasures.of(
        models, prior.pseudo_count or float(_drawn("pseudo_count", rng, 1)[0]), 1
    )
    if prior.pseudo_count is None:
        energies = np.log(rng.standard_gamma(1.0, base.energies.shape))
        base = BaseMeasures(base.kind, base.log_count, energies)
    rows = [rng.dirichlet(counts) for counts in base.pseudo_counts[0]]
    table = np.maximum(rows, LEAST)
    truth = models.parameters_of(table / table.sum(axis=1, keepdims=True))
    if isinstance(model, SemiMarkovModels):
        law = DwellPrior(prior.dwell_deviation)
        truth = np.concatenate([truth[: models.n_energies], law.mean(model)[models.n_energies :]])
        common = WIDE * rng.standard_normal()
        truth[model.means] += common + law.deviation * rng.standard_normal(model.n_laws)
        truth[model.shapes] += rng.standard_normal(model.n_laws)
    return weights, truth


def _drawn(strength: str, rng: np.random.Generator, n: int) -> FloatArray:
    median, spread = HYPERPRIORS[strength]
    return np.asarray(median * np.exp(spread * rng.standard_normal(n)))


def demonstrated(
    family: Family,
    weights: FloatArray,
    truth: FloatArray,
    rng: np.random.Generator,
    belief: FloatArray | None = None,
) -> Decisions:
    """Decisions of a soft expert who believes in the truth, or else, in episodes from anywhere."""
    model, mdp = family.problem.mdp.transitions, family.problem.mdp
    believed = model.local_probabilities(truth if belief is None else belief)
    policy = soft_policy(family.problem, weights, believed).probabilities
    starts = np.where(mdp.final, 0.0, 1.0)
    starts /= starts.sum()
    n, length = family.n_episodes, family.n_steps
    if isinstance(model, SemiMarkovModels):
        return sample_timed_decisions(
            mdp, policy, truth, starts, n_episodes=n, n_steps=length, rng=rng
        )
    table = model.local_probabilities(truth)
    return sample_decisions(mdp, policy, table, starts, n_episodes=n, n_steps=length, rng=rng)


def uniformity(ranks: IntArray, n_draws: int = N_RANKED, n_bins: int = 8) -> FloatArray:
    """(n,) p-value of each number's ranks by the chi-squared test in bins of equal width."""
    bins = ranks * n_bins // (n_draws + 1)
    counts = np.stack([np.bincount(column, minlength=n_bins) for column in bins.T])
    return np.asarray(scipy.stats.chisquare(counts, axis=1).pvalue)
