"""What a fit found about dwell times, and how much slower moves are in each place.

Of a move that nobody makes the choices reveal little more than mu / P, its mean dwell time over the
probability of its outcome, so log(mu / P) is given with an interval of its own. What is known of a
law is the divergence of its log mean from what was known before, in nats, as of normal densities:

    from dwell times   KLD( p(log mu_d | all dwell times) || p(log mu_d | those of other laws) )
    from choices       KLD( p(log mu_d | dwell times and choices) || p(log mu_d | all dwell times) )

Places are a second step, after the laws l are learned: a multiplier of dwell times per state,

    log mean of law d in state s = l_d + b_s,    b_s ~ Normal(0, sd^2)

with sd by Laplace's approximation of its evidence and a log-normal hyperprior. Where places do not
differ, sd and with it all b_s go to 0.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from serd_core.arrays import FloatArray, IntArray, floored, weighted_counts
from serd_core.bayes.information import learned_outcomes, named_source
from serd_core.bayes.laplace import Laplace, PosteriorDraws
from serd_core.checks import float_array, require_count
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.priors.prior import terms_of
from serd_core.semi_markov.dwell_likelihood import (
    DwellObservations,
    DwellPrior,
    counted_parameters,
    dwell_times,
)
from serd_core.semi_markov.models import NO_LAW, SemiMarkovModels, require_timed

#: Median of sd and spread of its logarithm; the range in which the best one is searched.
MEDIAN, SPREAD, LEAST, MOST = 0.3, 1.0, 1e-3, 3.0
#: Newton steps, the longest of them, and the last, in log multipliers.
STEPS, LONGEST, SMALL = 100, 1.0, 1e-9
#: Standard errors by which a law must lead a simpler one.
LEAD = 2.0
#: Fewer say nothing of their standard error.
LEAST_EPISODES = 3
#: What is chosen from.
LOCAL_LAWS, PLACES = "laws of local models", "laws and places"


@dataclass(frozen=True, eq=False)
class PlacePaces:
    """log_pace: (S,) b_s; its_deviation: (S,) posterior standard deviations; deviation: sd."""

    log_pace: FloatArray
    its_deviation: FloatArray
    deviation: float


@dataclass(frozen=True, eq=False)
class PlaceComparison:
    """chosen: `LOCAL_LAWS` or `PLACES`, the one to take.

    log_likelihood: (2,) of both, held out, in nats per dwell time; lead: of places over laws, in
    nats per episode; its_error: standard error of the lead.
    """

    chosen: str
    log_likelihood: FloatArray
    lead: float
    its_error: float


def fit_places(problem: Problem, decisions: Decisions, parameters: FloatArray) -> PlacePaces:
    """Find how much slower moves are in each state, the laws being those of (N,) parameters.

    Returns log_pace (S,), by which log means are moved, and its standard deviations.
    `semi_markov_problem(problem, log_pace=...)` plans with them. SerdError where moves take no time
    or have multipliers already, or decisions have no dwell times.

        fit = sc.fit_mdce_serd(timed, decisions)
        places = sc.fit_places(timed, decisions, fit.parameters.truth)
        timed = sc.semi_markov_problem(timed, log_pace=places.log_pace)
        table = timed.mdp.transitions.local_probabilities(fit.parameters.truth)
    """
    model, dwells = _without_paces(problem), dwell_times(problem.mdp, decisions)
    if dwells is None:
        raise SerdError("problem must have laws of dwell times, got none; leave out places")
    theta, state = float_array("parameters", parameters, (model.n_parameters,)), decisions.state
    seen = _Places(dwells, theta, state[dwells.row], model.n_states)

    def loss(log_deviation: float) -> float:
        away = (log_deviation - np.log(MEDIAN)) / SPREAD
        return float(0.5 * away**2) - seen.log_evidence(float(np.exp(log_deviation)))

    found = minimize_scalar(loss, bounds=(np.log(LEAST), np.log(MOST)), method="bounded")
    deviation = float(np.exp(found.x))
    pace, bend, _ = seen.most_likely(deviation)
    return PlacePaces(pace, 1.0 / np.sqrt(bend), deviation)


@dataclass(frozen=True, eq=False)
class _Places:
    """Dwell times and (T,) states of their decisions, under (N,) parameters."""

    dwells: DwellObservations
    theta: FloatArray
    state: IntArray
    n_states: int

    def most_likely(self, deviation: float) -> tuple[FloatArray, FloatArray, float]:
        """(S,) b, minus the second derivatives of the log posterior there, and its value."""
        pace = np.zeros(self.n_states)
        for _ in range(STEPS):
            found = self.dwells.paced(pace[self.state]).by_pace(self.theta)
            value, slope, bend = (weighted_counts(self.state, x, self.n_states) for x in found)
            # Mixtures may bend up far from their maximum.
            curvature = np.maximum(1.0 / deviation**2 - bend, 0.5 / deviation**2)
            step = (slope - pace / deviation**2) / curvature
            if np.abs(step).max() < SMALL:
                break
            pace = pace + np.clip(step, -LONGEST, LONGEST)
        return pace, curvature, float(np.sum(value - 0.5 * (pace / deviation) ** 2))

    def log_evidence(self, deviation: float) -> float:
        """Log evidence of sd."""
        _, bend, value = self.most_likely(deviation)
        return value - float(self.n_states * np.log(deviation) + 0.5 * np.sum(np.log(bend)))


def compare_places(problem: Problem, decisions: Decisions, n_folds: int = 5) -> PlaceComparison:
    """Test on episodes that were left out whether dwell times differ by place.

    Laws are counted (`estimate_dynamics`). n_folds: parts of the episodes, of which each is left
    out once. Returns what to take (`chosen`), and the lead of places in nats per episode with its
    standard error. SerdError where there are fewer than three episodes, moves take no time or have
    multipliers already, or decisions have no dwell times.

        print(sc.compare_places(timed, decisions).chosen)
    """
    require_count("n_folds", n_folds, 2, "5")
    _without_paces(problem)
    episodes = decisions.episodes
    if len(episodes) < LEAST_EPISODES:
        raise SerdError(
            f"decisions must hold at least {LEAST_EPISODES} episodes to compare those left out,"
            f" got {len(episodes)}; record more"
        )
    by_episode, n_dwells = np.zeros((2, len(episodes))), 0
    for fold in range(min(n_folds, len(episodes))):
        out = np.isin(decisions.episode, episodes[fold::n_folds])
        train, test = decisions.select(~out), decisions.select(out)
        known = estimate_dynamics(problem, train)
        pace = fit_places(problem, train, known).log_pace
        found = dwell_times(problem.mdp, test)
        assert found is not None
        n_dwells += len(found.row)
        number = np.searchsorted(episodes, test.episode[found.row])
        both = found, found.paced(pace[test.state[found.row]])
        for row, tested in enumerate(both):
            each = tested.by_decision(known)
            by_episode[row] += weighted_counts(number, each, len(episodes))
    ahead = by_episode[1] - by_episode[0]
    lead, error = float(ahead.mean()), float(ahead.std(ddof=1) / np.sqrt(len(episodes)))
    chosen = PLACES if lead > LEAD * error else LOCAL_LAWS
    return PlaceComparison(chosen, by_episode.sum(axis=1) / max(n_dwells, 1), lead, error)


def _without_paces(problem: Problem) -> SemiMarkovModels:
    """Its models; SerdError where places have multipliers."""
    model = require_timed(problem.mdp.transitions)
    if model.log_pace.any():
        raise SerdError("problem must have no log_pace yet; pass the problem without it")
    return model


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
    """Summarise what a fit found about dwell times: laws, intervals, and what informed them.

    found: of `laplace`; draws: of `interval_draws`; mass: that intervals hold, which are NaN where
    the chains did not mix. SerdError where moves take no time, or the fit learned no dynamics.

        found = sc.laplace(timed, decisions, fit)
        laws = sc.dwell_summary(found, sc.interval_draws(found, rng))
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
        mean_interval_s=np.exp(draws.interval(log_means, mass)),
        log_mean_over_probability=draws.interval(of_outcomes - np.log(floored(outcomes)), mass),
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
    precision, by_law = prior.precision(model, counted)[laws, laws], []
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
