"""Likelihood of dwell times, given the moves they belong to, and their prior.

A decision of (s, a) that took t seconds and ended in s' has, with the outcomes k in E that lead to
s', densities f_k and survival functions S_k of their laws,

    log P(t | s, a, s') = log sum_{k in E} P(k) f_k(t) - log sum_{k in E} P(k)

and one that was censored at t has log sum_k P(k) S_k(t) over all outcomes. A given duration has
S = 1 up to it, and no density. The outcomes of one law among E are a *part* of the decision here,
with the weight W = sum of their probabilities; with q the share of a part in a decision's sum,

    dL  = sum q (d log W + dl) - sum d log(sum W)
    d2L = sum q (d2 log W + d2 l) + Cov_q[d log W + dl] - sum d2 log(sum W)

    log mean_d ~ Normal(l, sd^2),   l ~ Normal(0, WIDE^2),   log shape_d ~ Normal(log 4, 1)

Means are in seconds. l is integrated out: the log means have the covariance sd^2 I + WIDE^2 1 1^T.
A narrow sd bends the durations of moves that nobody makes to those of the others. A decision that
has not moved ends in its own state after T seconds, so moves take less. Where T is given, the prior
density is multiplied by Phi((log T_d - log mean_d) / BLUR), and divided by the integral of all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr, ndtri

from serd_core.arrays import BoolArray, FloatArray, IntArray, weighted_counts
from serd_core.ascent.ascent import Objective
from serd_core.ascent.trust_region import NewtonAscent
from serd_core.checks import require_kind, require_positive
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp
from serd_core.posterior.parameters import Block, Parameters
from serd_core.priors.prior import LogPrior, Prior, require_dynamics_block
from serd_core.semi_markov.gamma_law import ByMeanAndShape, log_density, log_survival
from serd_core.semi_markov.models import SemiMarkovModels, require_timed

#: To what share of itself a dwell time is known at best.
RESOLUTION = 1e-3
#: Log likelihood of what cannot be, and least probability of which a logarithm is taken.
IMPOSSIBLE, LEAST = -1e3, 1e-300


@dataclass(frozen=True, eq=False)
class _Parts:
    """Of (..., P) parts: log density or survival l, W, the shares q and W / sum W; log of the sum.

    (...) are those of parameters.
    """

    logs: ByMeanAndShape
    weight: FloatArray
    share: FloatArray
    prior: FloatArray
    log_sum: FloatArray


@dataclass(frozen=True, eq=False)
class DwellObservations:
    """T decisions that inform laws of dwell times, in P parts.

    row: (T,) numbers of the decisions; log_dwell: (T,) log seconds less the pace of the state;
    log_pace: (T,) that pace; censored: (T,). decision, law: (P,) of each part, law -1 where the
    duration is given; over: (P,) whether that is over. outcomes: (G, M*K) distinct masks of the
    outcomes of a part; mask: (P,) that of each part.
    """

    model: SemiMarkovModels
    row: IntArray
    log_dwell: FloatArray
    log_pace: FloatArray
    censored: BoolArray
    decision: IntArray
    law: IntArray
    over: BoolArray
    outcomes: FloatArray
    mask: IntArray
    _last: list[tuple[FloatArray, _Parts]] = field(default_factory=list, init=False, repr=False)

    def paced(self, log_pace: FloatArray) -> "DwellObservations":
        """The same, with log means of the decisions moved by (T,) more."""
        moved, total = self.log_dwell - log_pace, self.log_pace + log_pace
        return replace(self, log_dwell=moved, log_pace=total)

    def by_decision(self, theta: FloatArray) -> FloatArray:
        """(..., T) log-likelihood of each decision at (..., N) parameters."""
        return self._by_decision(self._parts(theta))

    def by_pace(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(T,) the same, with first and second derivatives by what log means are moved by."""
        found, n = self._parts(theta), len(self.row)
        slope = weighted_counts(self.decision, found.share * found.logs.mean, n)
        bend = found.share * (found.logs.mean_mean + found.logs.mean**2)
        return self._by_decision(found), slope, weighted_counts(self.decision, bend, n) - slope**2

    def evaluate(self, theta: FloatArray) -> tuple[float, FloatArray]:
        """Log-likelihood and (N,) gradient at (N,) parameters."""
        found = self._parts(theta)
        gradient = self.model.outcomes.pull_back(theta, self._by_outcome(found))
        slopes = found.logs.mean, found.logs.shape
        for column, slope in zip(self._columns, slopes, strict=True):
            gradient += weighted_counts(column, found.share * slope, len(theta))
        return float(self._by_decision(found).sum()), gradient

    def scores(self, theta: FloatArray) -> FloatArray:
        """(T, N) gradient of the log-likelihood of each decision."""
        found, outcomes = self._parts(theta), self.outcomes[self.mask]
        by_part = ((found.share - found.prior) / found.weight)[:, None] * outcomes
        by_outcome = np.add.reduceat(by_part, self._first)
        table = by_outcome @ self.model.outcomes.local_jacobian(theta)
        slopes = found.logs.mean, found.logs.shape
        for column, by_law in zip(self._columns, slopes, strict=True):
            np.add.at(table, (self.decision, column), found.share * by_law)
        return np.asarray(table)

    def hessian(self, theta: FloatArray) -> FloatArray:
        """(N, N) second derivatives."""
        found, (mean, shape) = self._parts(theta), self._columns
        table = self._of_mixtures(theta, found)
        bends = found.logs.mean_mean, found.logs.mean_shape, found.logs.shape_shape
        mean_mean, mean_shape, shape_shape = (found.share * bend for bend in bends)
        np.add.at(table, (mean, mean), mean_mean)
        np.add.at(table, (mean, shape), mean_shape)
        np.add.at(table, (shape, mean), mean_shape)
        np.add.at(table, (shape, shape), shape_shape)
        return np.asarray(table)

    def _of_mixtures(self, theta: FloatArray, found: _Parts) -> FloatArray:
        """(N, N) what decisions of several parts add to sum q d2 l."""
        mixed = np.flatnonzero(np.bincount(self.decision)[self.decision] > 1)
        outcomes, of_decision = self.model.outcomes, self.decision[mixed]
        if not len(mixed):
            return np.zeros((len(theta), len(theta)))
        table = outcomes.local_curvature(theta, self._by_outcome(found))
        slopes = self.outcomes @ outcomes.local_jacobian(theta)
        scores = slopes[self.mask[mixed]] / found.weight[mixed, None]
        share, prior = found.share[mixed], found.prior[mixed]
        # d2 log W = d2 W / W - (d log W)^2, with q for the parts and W / sum W for their sum.
        table -= (scores * (share - prior)[:, None]).T @ scores
        table -= _covariance(of_decision, prior, scores)
        (mean, shape), rows = self._columns, np.arange(len(mixed))
        scores[rows, mean[mixed]] += found.logs.mean[mixed]
        scores[rows, shape[mixed]] += found.logs.shape[mixed]
        return table + _covariance(of_decision, share, scores)

    @cached_property
    def _first(self) -> IntArray:
        """(T,) first part of each decision, whose parts follow each other."""
        return np.searchsorted(self.decision, np.arange(len(self.row)))

    @cached_property
    def _columns(self) -> tuple[IntArray, IntArray]:
        """(P,) place of each part's log mean and log shape, on which given durations do not act."""
        law = np.maximum(self.law, 0)
        return self.model.means.start + law, self.model.shapes.start + law

    def _parts(self, theta: FloatArray) -> _Parts:
        """Those of the last parameters are kept."""
        if not (self._last and np.array_equal(self._last[0][0], theta)):
            self._last[:] = [(np.array(theta), self._parts_at(theta))]
        return self._last[0][1]

    def _parts_at(self, theta: FloatArray) -> _Parts:
        mean, shape = self._columns
        logs = np.zeros((6, *theta.shape[:-1], len(self.law)))
        logs[0, ..., self.over] = IMPOSSIBLE
        log_dwell = self.log_dwell[self.decision]
        censored, has_law = self.censored[self.decision], self.law >= 0
        for kind, of_law in ((~censored, log_density), (censored, log_survival)):
            rows = np.flatnonzero(has_law & kind)
            of_rows = theta[..., mean[rows]], theta[..., shape[rows]]
            logs[..., rows] = of_law(log_dwell[rows], *of_rows)
        table = self.model.outcomes.local_probabilities(theta)
        table = table.reshape(*theta.shape[:-1], self.model.outcomes.n_energies)
        weight = np.maximum(table @ self.outcomes.T, LEAST)[..., self.mask]
        of_decision, first = self.decision, self._first
        prior = weight / np.add.reduceat(weight, first, axis=-1)[..., of_decision]
        joint = np.log(prior) + logs[0]
        largest = np.maximum.reduceat(joint, first, axis=-1)
        share = np.exp(joint - largest[..., of_decision])
        total = np.add.reduceat(share, first, axis=-1)
        share /= total[..., of_decision]
        return _Parts(ByMeanAndShape(*logs), weight, share, prior, largest + np.log(total))

    def _by_decision(self, found: _Parts) -> FloatArray:
        # Densities are per second.
        return found.log_sum - np.where(self.censored, 0.0, self.log_pace)

    def _by_outcome(self, found: _Parts) -> FloatArray:
        """(M, K) gradient by the probabilities."""
        by_part = (found.share - found.prior) / found.weight
        by_mask = weighted_counts(self.mask, by_part, len(self.outcomes))
        outcomes = self.model.outcomes
        return (by_mask @ self.outcomes).reshape(outcomes.n_models, outcomes.n_outcomes)


def _covariance(of_decision: IntArray, share: FloatArray, scores: FloatArray) -> FloatArray:
    """(N, N) sum over decisions of Cov of (Q, N) scores under (Q,) shares."""
    _, first, place = np.unique(of_decision, return_index=True, return_inverse=True)
    centred = scores - np.add.reduceat(share[:, None] * scores, first)[place]
    return np.asarray((centred * share[:, None]).T @ centred)


def dwell_times(
    mdp: Mdp, decisions: Decisions, name: str = "decisions"
) -> DwellObservations | None:
    """The dwell times that inform laws of an MDP; None where moves take no time."""
    model = mdp.transitions
    if not isinstance(model, SemiMarkovModels) or not model.n_laws:
        return None
    if not isinstance(decisions, TimedDecisions):
        raise SerdError(
            f"{name} must have dwell times for moves that take time, got"
            f" {type(decisions).__name__}; pass TimedDecisions"
        )
    action = np.maximum(decisions.action, 0)
    row_of = model.model_of[decisions.state, action]
    law = model.row_law[row_of]
    leads = model.successors[decisions.state, action] == decisions.next_state[:, None]
    leads = (leads | decisions.censored[:, None]) & ~decisions.hidden[:, None]
    used = np.flatnonzero(np.any(leads & (law >= 0), axis=1))
    decision, outcome = np.nonzero(leads[used])
    row = row_of[used[decision]]
    given_s = model.given_s[row, outcome]
    over = (given_s > 0) & (decisions.dwell_s[used[decision]] > given_s)
    # Equal laws are one part; a given duration that is over is another than one that is not.
    kind = np.stack([decision, model.row_law[row, outcome], over], axis=1)
    parts, part = np.unique(kind, axis=0, return_inverse=True)
    number = model.row_model[row] * model.n_outcomes + outcome
    of_parts = np.zeros((len(parts), model.outcomes.n_energies), dtype=np.bool_)
    of_parts[part.reshape(-1), number] = True
    outcomes, mask = np.unique(of_parts, axis=0, return_inverse=True)
    pace, censored = model.log_pace[row_of[used]], decisions.censored[used]
    log_dwell, laws = np.log(decisions.dwell_s[used]), np.full(len(used), -1)
    ended = np.searchsorted(parts[:, 0], np.flatnonzero(~censored))
    laws[~censored] = parts[ended, 1]
    # Equal times of a law, as in tracks of constant speed, have no likeliest shape: spread them.
    for one in np.unique(laws[laws >= 0]):
        rows = np.flatnonzero(laws == one)
        if len(rows) > 1 and np.ptp(log_dwell[rows]) < RESOLUTION:
            log_dwell[rows] += RESOLUTION * ndtri((np.arange(len(rows)) + 0.5) / len(rows))
    return DwellObservations(
        model=model,
        row=used,
        log_dwell=log_dwell - pace,
        log_pace=pace,
        censored=censored,
        decision=parts[:, 0],
        law=parts[:, 1],
        over=parts[:, 2] > 0,
        outcomes=outcomes.astype(np.float64),
        mask=mask.reshape(-1),
    )


#: Standard deviation of the common log mean; median shape and sd of its logarithm.
WIDE, MEDIAN_SHAPE, SHAPE_DEVIATION = 3.0, 4.0, 1.0
#: Width in nats of the bound on log means, so that maxima are not on it.
BLUR = 0.2


@dataclass(frozen=True)
class DwellPrior(Prior):
    """A prior on laws of dwell times, which completes the prior on outcomes of the same block.

    deviation: sd of the log means around a common one, which is free; log shapes are normal around
    log 4 with sd 1. Means are below the time after which a decision that has not moved ends, where
    there is one. block: `Block.TRUTH` or `Block.BELIEF`. SerdError where moves take no time.

        prior = sc.DirichletPrior(1.0) + sc.DwellPrior(1.0)
    """

    deviation: float
    block: Block = Block.TRUTH

    def __post_init__(self) -> None:
        require_positive("deviation of DwellPrior", self.deviation)
        require_kind("block", self.block, (Block,), "Block.TRUTH")
        require_dynamics_block("DwellPrior", self.block)

    @property
    def blocks(self) -> tuple[Block, ...]:
        return ()

    def evaluate(self, model: TransitionModel, parameters: Parameters) -> LogPrior:
        value, slope = self.of_laws(require_timed(model), parameters.block(self.block))
        return LogPrior(value, parameters.zeros().with_block(self.block, slope))

    def values(self, model: TransitionModel, at: Sequence[Parameters]) -> FloatArray:
        theta = np.stack([each.block(self.block) for each in at])
        return self._log_densities(require_timed(model), theta)

    def hessian(self, model: TransitionModel, parameters: Parameters) -> FloatArray:
        table = self.precision(require_timed(model), parameters.block(self.block))
        return parameters.placed(self.block, -table)

    def log_constant(self, model: TransitionModel, parameters: Parameters) -> float:
        del parameters
        timed, variance = require_timed(model), self.deviation**2
        n = timed.n_laws
        log_det = (n - 1) * np.log(variance) + np.log(variance + n * WIDE**2)
        log_det += 2.0 * n * np.log(SHAPE_DEVIATION)
        within = self._log_share_below(timed.log_longest_s)
        return -0.5 * float(log_det) - n * float(np.log(2.0 * np.pi)) - within

    def of_laws(self, model: SemiMarkovModels, theta: FloatArray) -> tuple[float, FloatArray]:
        """Log density up to `log_constant`, and its (N,) gradient, at (N,) parameters."""
        away, pull = theta - self.mean(model), np.zeros(model.n_parameters)
        means, shapes = away[model.means], away[model.shapes]
        pull[model.means] = (means - self._shared(model) * means.sum()) / self.deviation**2
        pull[model.shapes] = shapes / SHAPE_DEVIATION**2
        pull[model.means] += _log_below(model.log_longest_s - theta[model.means])[1]
        return float(self._log_densities(model, theta[None])[0]), -pull

    def _log_densities(self, model: SemiMarkovModels, theta: FloatArray) -> FloatArray:
        """(n,) log density up to `log_constant` at (n, N) parameters."""
        away = theta - self.mean(model)
        means, shapes = away[:, model.means], away[:, model.shapes]
        squares = np.sum(means**2, axis=1) - self._shared(model) * means.sum(axis=1) ** 2
        squares = squares / self.deviation**2 + np.sum((shapes / SHAPE_DEVIATION) ** 2, axis=1)
        below = _log_below(model.log_longest_s - theta[:, model.means])[0]
        return np.asarray(below.sum(axis=1) - 0.5 * squares)

    def mean(self, model: SemiMarkovModels) -> FloatArray:
        """(N,) prior mean of log means and log shapes; 0 for energies."""
        found = np.zeros(model.n_parameters)
        found[model.shapes] = np.log(MEDIAN_SHAPE)
        return found

    def precision(self, model: SemiMarkovModels, theta: FloatArray) -> FloatArray:
        """(N, N) minus the second derivatives at (N,) parameters, 0 for energies.

        The inverse of the covariance of log means is by Sherman and Morrison.
        """
        table, identity = np.zeros((model.n_parameters,) * 2), np.eye(model.n_laws)
        _, _, bend = _log_below(model.log_longest_s - theta[model.means])
        normal = (identity - self._shared(model)) / self.deviation**2
        table[model.means, model.means] = normal - np.diag(bend)
        table[model.shapes, model.shapes] = identity / SHAPE_DEVIATION**2
        return table

    def _log_share_below(self, log_longest: FloatArray) -> float:
        """Log of the share of the normal density that the bounds leave, by the trapezoidal rule."""
        spread = float(np.hypot(self.deviation, BLUR))
        common = np.arange(-8.0 * WIDE, 8.0 * WIDE, spread / 4.0)
        logs = log_ndtr((log_longest - common[:, None]) / spread).sum(axis=1)
        logs -= 0.5 * (common / WIDE) ** 2
        return float(np.log(np.exp(logs).sum() * spread / 4.0 / WIDE / np.sqrt(2.0 * np.pi)))

    def _shared(self, model: SemiMarkovModels) -> float:
        """What each log mean has of the sum of all, in units of the precision of one."""
        return WIDE**2 / (self.deviation**2 + model.n_laws * WIDE**2)


def _log_below(room: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """log Phi(room / BLUR) of (D,) log bounds less log means.

    Also the first derivative by the room, and the second.
    """
    away = np.where(np.isfinite(room), room / BLUR, 0.0)
    logs = log_ndtr(away)
    hazard = np.exp(-0.5 * away**2 - logs) / np.sqrt(2.0 * np.pi)
    found = logs, hazard / BLUR, -hazard * (away + hazard) / BLUR**2
    value, slope, bend = (np.where(np.isfinite(room), each, 0.0) for each in found)
    return value, slope, bend


#: With the usual deviation of log means around their common one.
PRIOR = DwellPrior(1.0)


@dataclass(frozen=True, eq=False)
class _LawPosterior(Objective):
    """The log posterior of laws by their (2D,) numbers, under (M*K,) energies."""

    model: SemiMarkovModels
    dwells: DwellObservations
    energies: FloatArray
    prior: DwellPrior

    def evaluate(self, vector: FloatArray) -> tuple[float, FloatArray]:
        theta = np.concatenate([self.energies, vector])
        value, slope = self.dwells.evaluate(theta)
        of_prior, pull = self.prior.of_laws(self.model, theta)
        return value + of_prior, (slope + pull)[len(self.energies) :]

    def hessian(self, vector: FloatArray) -> FloatArray:
        theta, laws = np.concatenate([self.energies, vector]), slice(len(self.energies), None)
        bend = self.dwells.hessian(theta)
        return (bend - self.prior.precision(self.model, theta))[laws, laws]


def counted_parameters(
    model: SemiMarkovModels,
    outcome_probabilities: FloatArray,
    dwells: DwellObservations | None,
    prior: DwellPrior = PRIOR,
) -> FloatArray:
    """(N,) parameters with given (M, K) probabilities and the most likely laws of dwell times."""
    start = model.outcomes.parameters_of(outcome_probabilities)
    energies = start[: model.means.start]
    start = np.concatenate([energies, prior.mean(model)[len(energies) :]])
    if dwells is None or not len(dwells.row):
        return start
    start[model.means] = float(np.mean(dwells.log_dwell))
    posterior = _LawPosterior(model, dwells, energies, prior)
    found = NewtonAscent().maximise(posterior, start[len(energies) :])
    if not found.converged:
        raise SerdError(
            f"the laws of dwell times must converge, but after {found.n_steps} steps got"
            f" {found.message!r}; pass dynamics (`SemiMarkovModels.parameters_from`)"
        )
    return np.concatenate([energies, found.vector])
