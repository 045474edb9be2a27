"""What a fit found about dwell times.

Of a move that nobody makes the choices reveal little more than mu / P, its mean dwell time over the
probability of its outcome, so log(mu / P) is given with an interval of its own. What is known of a
law is the divergence of its log mean from what was known before, in nats:

    from dwell times   KLD( p(log mu_d | all dwell times) || p(log mu_d | those of other laws) )
    from choices       KLD( p(log mu_d | dwell times and choices) || p(log mu_d | all dwell times) )

Each is taken as normal: the first two by Laplace's approximation, the posterior by the mean and
variance of its draws, as it has a long tail where nobody makes a move.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import (
    FloatArray,
    floored,
    weighted_counts,
)
from serd_core.bayes.information import interval, learned_outcomes, named_source
from serd_core.bayes.laplace import Laplace, PosteriorDraws
from serd_core.priors.prior import terms_of
from serd_core.semi_markov.dwell_prior import DwellPrior, counted_parameters
from serd_core.semi_markov.models import NO_LAW, SemiMarkovModels, require_timed


@dataclass(frozen=True, eq=False)
class DwellSummary:
    """Of one block of parameters, with M models, K outcomes and D laws.

    mean_s, shape: (D,) of the fit, at the pace 0.
    mean_interval_s: (3, D) lower end, median and upper end of the central interval.
    log_mean_over_probability: (3, M, K) the same of log(mean_s / P) of each outcome; NaN for
    outcomes without a law.
    n_chosen: (M,) decisions in which each model was chosen.
    n_dwells: (D,) dwell times that inform each law, with those that a command ended.
    from_dwells, from_choices: (D,) nats.
    weight_correlation: (F, D) posterior correlation of reward weights and log means: near 1 or -1
    the demonstrations cannot distinguish a dislike of moves from their slowness.
    """

    mean_s: FloatArray
    shape: FloatArray
    mean_interval_s: FloatArray
    log_mean_over_probability: FloatArray
    n_chosen: FloatArray
    n_dwells: FloatArray
    from_dwells: FloatArray
    from_choices: FloatArray
    weight_correlation: FloatArray

    def source(self, law: int) -> str:
        """Where what is known of a law comes from."""
        return named_source(dwell_times=self.from_dwells[law], choices=self.from_choices[law])


def dwell_summary(found: Laplace, draws: PosteriorDraws, mass: float = 0.9) -> DwellSummary:
    """Laws of dwell times of the world, and what is known of them.

    draws: of the posterior; mass: that intervals hold. SerdError where moves take no time, or the
    fit learned no dynamics.

        found = sc.laplace(timed, decisions, fit)
        laws = sc.dwell_summary(found, sc.laplace_draws(found, rng, 400))
        unseen = laws.n_chosen == 0
        print(np.exp(laws.log_mean_over_probability[:, unseen]))
    """
    model = require_timed(found.problem.mdp.transitions)
    at = found.coordinates.parameters(found.mode)
    log_means = draws.truth[:, model.means]
    outcomes = model.outcomes.local_probabilities(draws.truth)
    of_outcomes = np.where(model.law_of == NO_LAW, np.nan, log_means[:, model.law_of])
    seen = found.posterior.observations
    chosen = weighted_counts(
        model.row_model[model.model_of].ravel(), seen.state_action.ravel(), model.outcomes.n_models
    )
    informed = seen.dwells.law if seen.dwells else np.zeros(0, dtype=np.int64)
    from_dwells, from_choices = _informed(found, model, log_means)
    away, weights = (each - each.mean(axis=0) for each in (log_means, draws.reward))
    lengths = np.outer(np.linalg.norm(weights, axis=0), np.linalg.norm(away, axis=0))
    return DwellSummary(
        mean_s=np.exp(at.truth[model.means]),
        shape=np.exp(at.truth[model.shapes]),
        mean_interval_s=np.exp(interval(log_means, mass)),
        log_mean_over_probability=interval(of_outcomes - np.log(floored(outcomes)), mass),
        n_chosen=chosen,
        n_dwells=np.bincount(informed[informed >= 0], minlength=model.n_laws).astype(np.float64),
        from_dwells=from_dwells,
        from_choices=from_choices,
        weight_correlation=(weights.T @ away) / np.maximum(lengths, np.finfo(np.float64).tiny),
    )


def _informed(
    found: Laplace, model: SemiMarkovModels, log_means: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(D,) nats about log means from dwell times, and from choices, by (n, D) draws."""
    outcomes, blocks = learned_outcomes(found)
    terms = terms_of(found.posterior.prior)
    (prior,) = (each for each in terms if isinstance(each, DwellPrior) and each.block in blocks)
    at, dwells = found.coordinates.parameters(found.mode), found.posterior.observations.dwells
    counted = counted_parameters(model, outcomes.local_probabilities(at.truth), dwells, prior)
    laws = slice(model.means.start, model.n_parameters)
    slope, bend = np.zeros(2 * model.n_laws), np.zeros((2 * model.n_laws,) * 2)
    if dwells is not None:
        slope, bend = dwells.evaluate(counted)[1][laws], dwells.hessian(counted)[laws, laws]
    precision, by_law = prior.precision(model)[laws, laws], []
    variance = np.diag(np.linalg.inv(precision - bend))
    for law in range(model.n_laws):
        own = np.isin(np.arange(2 * model.n_laws), [law, law + model.n_laws])
        without = precision - np.where(own[:, None] | own, 0.0, bend)
        # Newton's step to the maximum without the dwell times of this law.
        back = np.linalg.solve(without, np.where(own, slope, 0.0))[law]
        before = np.linalg.inv(without)[law, law]
        moved = log_means[:, law].mean() - counted[model.means][law]
        after = log_means[:, law].var(ddof=1)
        of_dwells = _divergence(back, variance[law], before)
        by_law.append((of_dwells, _divergence(moved, after, variance[law])))
    from_dwells, from_choices = np.array(by_law).T
    return from_dwells, from_choices


def _divergence(moved: float, variance: float, before: float) -> float:
    """KLD of Normal(moved, variance) from Normal(0, before)."""
    ratio = variance / before
    return max(0.0, 0.5 * float(ratio - 1.0 + moved**2 / before - np.log(ratio)))
