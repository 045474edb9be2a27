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
from serd_core.bayes.laplace import PosteriorDraws, interval_draws, laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions, sample_timed_decisions
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior.coordinates import feature_ranges
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
    """As the product draws for intervals."""
    return interval_draws(laplace(problem, decisions, fit), rng)


def calibration_ranks(
    family: Family, rng: np.random.Generator, draw: Draw = draw_by_sweeps
) -> IntArray:
    """(n,) ranks of the true weights, outcome probabilities, log means and log shapes of laws.

    They are among the last states of as many chains; -1 where an interval has not mixed, so that
    none is printed.
    """
    weights, truth = drawn_truth(family, rng)
    decisions = demonstrated(family, weights, truth, rng)
    drawn = draw(family.problem, decisions, fit_by_own_prior(family, decisions), rng)
    values = numbers_of(family.problem, drawn.reward, drawn.truth)
    true = numbers_of(family.problem, weights[None], truth[None])
    ranks = np.sum(values[-N_RANKED:] < true, axis=0)
    return np.where(np.isnan(drawn.interval(values)[0]), -1, ranks)


def numbers_of(problem: Problem, reward: FloatArray, truth: FloatArray) -> FloatArray:
    """(n, F + M K + ...) weights, outcome probabilities, log means and log shapes of laws."""
    models = require_outcome_models(problem.mdp.transitions, "calibration")
    outcomes = models.local_probabilities(truth).reshape(len(truth), -1)
    return np.hstack([reward, outcomes, truth[:, models.n_energies :]])


def fit_by_own_prior(family: Family, decisions: Decisions) -> FitResult:
    """The fit of one who knows the prior that weights and dynamics are drawn from."""
    problem = family.problem
    start = np.zeros(len(problem.feature_names))
    return fit_mdce_serd(problem, decisions, initial_weights=start, prior=family.prior())


def drawn_truth(family: Family, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(F,) weights and (N,) parameters of the dynamics, drawn from the prior of a family."""
    problem, model = family.problem, family.problem.mdp.transitions
    models = require_outcome_models(model, "calibration")
    scales = family.deviations / feature_ranges(problem)
    weights = scales * rng.standard_normal(len(problem.feature_names))
    counts = np.ones(models.n_outcomes) * family.pseudo_counts
    table = np.maximum(rng.dirichlet(counts, models.n_models), LEAST)
    truth = models.parameters_of(table / table.sum(axis=1, keepdims=True))
    if isinstance(model, SemiMarkovModels):
        law = DwellPrior(1.0)
        truth = np.concatenate([truth[: models.n_energies], law.mean(model)[models.n_energies :]])
        common = WIDE * rng.standard_normal()
        truth[model.means] += common + law.deviation * rng.standard_normal(model.n_laws)
        truth[model.shapes] += rng.standard_normal(model.n_laws)
    return weights, truth


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
    """(n,) p-value of each number's ranks by the chi-squared test in bins of equal width.

    -1 is no rank.
    """
    bins = ranks * n_bins // (n_draws + 1)
    counts = [np.bincount(column[column >= 0], minlength=n_bins) for column in bins.T]
    return np.array([scipy.stats.chisquare(each).pvalue for each in counts])
