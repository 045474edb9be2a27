"""How much slower moves are in each place: a multiplier of dwell times per state.

    log mean of law d in state s = l_d + b_s,    b_s ~ Normal(0, sd^2)

This is a second step, after the laws l are learned: they stay as they are. Given sd, each b_s is
the maximum of its own posterior, and Laplace's approximation of the integrals over all b_s gives
the evidence of sd, whose hyperprior is log-normal. Where places do not differ, sd and with it all
b_s go to 0.

`compare_places` takes places where the likelihood of dwell times of episodes that were left out is
higher with them than with laws of local models alone, by more than two standard errors of the
difference per episode.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from serd_core.arrays import FloatArray, IntArray, float_array, require_count, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.semi_markov.dwell_likelihood import DwellObservations, dwell_times
from serd_core.semi_markov.models import SemiMarkovModels, require_timed

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
    """Multipliers of dwell times by state, the laws being those of (N,) parameters.

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
    """Whether dwell times differ by place, on episodes that were left out.

    Laws are counted (`estimate_dynamics`). n_folds: parts of the episodes, of which each is left
    out once. SerdError where there are fewer than three episodes, moves take no time or have
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
