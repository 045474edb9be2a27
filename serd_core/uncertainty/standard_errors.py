"""Information matrices of a fit, standard errors, and what the decisions do not determine.

    observed (Hessian):     -d2 J / d theta2                       (with the prior's part)
    outer product (BHHH):   sum over decisions of score score^T    (likelihood only)

The score of a decision is the gradient of log pi(a|s) + log P(s'|s,a), and with a hidden action its
mean over the actions that explain the move. Where moves take time log P(t|s,a,s') is added, and a
decision that a command ended has the survival of its dwell time in place of the last two.

The covariance is the inverse of a matrix M with the gauge taken out, where J is smooth and its
gradient 0; outcome probabilities get theirs by the delta method. M is brought into correlation
form, D M D with D = diag(M)^(-1/2), which changing units leaves as it is. A diagonal entry that is
nothing but the rounding of larger numbers is no scale; the size of what cancelled is taken instead.
Along a null direction all free numbers can move together without changing the likelihood; a
parameter that one moves has an infinite standard error, and so has a reward weight that only its
prior determines. Where the model is wrong, or decisions of
an episode depend on each other, the covariance is the sandwich M^-1 B M^-1 of the outer product B
of scores, summed by decision (White 1982) or by cluster (Liang and Zeger 1986).
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.checks import float_array, require_kind
from serd_core.demonstrations.decisions import Decisions, TimedDecisions
from serd_core.demonstrations.observations import observe, taken_transitions
from serd_core.display import Record
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, StandardErrors, require_fit
from serd_core.mdp.problem import Problem, require_problem
from serd_core.posterior.coordinates import free_gauge, free_names, free_scaling, gauge_free_basis
from serd_core.posterior.hessian import (
    Sensitivities,
    choice_scores,
    idle_weights,
    outcome_scores,
    posterior_hessian,
    sensitivities_at,
    transition_scores,
    vector_hessian,
)
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue, move_scores

#: Part of a null direction below which a parameter counts as not moved by it.
TOUCHED = 1e-6


def score_sizes(
    posterior: Posterior, parameters: Parameters, q: FloatArray, by_q: FloatArray
) -> FloatArray:
    """(blocks,) largest of the numbers whose differences make a decision's score, by parameter."""
    model, policy_model = posterior.problem.mdp.transitions, posterior.policy_model
    temperature = policy_model.temperature(parameters.policy)
    by_choice = np.abs(by_q).max(axis=(0, 1)) / temperature
    by_outcome = np.abs(model.local_jacobian(parameters.truth)).max(axis=0, initial=0.0)
    largest_q = float(np.abs(q[np.isfinite(q)]).max())
    by_temperature = np.full(len(parameters.policy), largest_q / temperature**2)
    return np.concatenate([by_choice, by_outcome, by_temperature])


@dataclass(frozen=True, eq=False, repr=False)
class Information(Record):
    """Both information matrices over n free numbers.

    names: (n,); observed, outer_product: (n, n); gradient: (n,) of J there, 0 at an optimum.
    score_sizes: (n,) largest of the numbers whose differences are the scores of one decision.
    n_decisions: how many; converged: whether the fit did, in what is determined.
    gauge: (g, n) directions that change nothing, such as a constant added to all energies of an
    outcome model. parameters: where they were taken; jacobian: (all blocks, n).
    key: (N,) transition of each decision, as in `Observations`. scores: (G + T, n) of the distinct
    ones in their order, of TimedDecisions of each decision with its action, and of T hidden moves.
    idle: (F,) reward weights that no choice determines.
    """

    names: tuple[str, ...]
    observed: FloatArray
    outer_product: FloatArray
    gradient: FloatArray
    score_sizes: FloatArray
    n_decisions: float
    converged: bool
    gauge: FloatArray
    parameters: Parameters
    jacobian: FloatArray
    key: IntArray
    scores: FloatArray
    idle: BoolArray


def fit_information(
    problem: Problem,
    decisions: Decisions,
    fit: FitResult,
) -> Information:
    """Compute the information matrices of a fit, from which standard errors follow.

    SerdError where the fit is one of another problem, or does not record what it assumed.

        information = sc.fit_information(problem, decisions, fit)
        errors = sc.standard_errors(problem, information)
    """
    require_problem(problem)
    require_fit(fit)
    assumed = fit.assumed
    _require_fitting(problem, fit)
    observations = observe(problem, decisions)
    whole_prior = assumed.whole_prior.anchored(fit.initial_outcome_probabilities)
    posterior = Posterior(problem, observations, assumed.policy_model, whole_prior)
    at = posterior.evaluate(fit.parameters)
    found = sensitivities_at(posterior, fit.parameters, at)
    hessian = posterior_hessian(posterior, fit.parameters, at, found)
    jacobian = assumed.belief.jacobian(fit.parameters)
    scores = transition_scores(posterior, fit.parameters, at, found)
    hidden, counts = move_scores(at.expected, scores), observations.group_count
    if isinstance(decisions, TimedDecisions):
        scores = _scores_of_timed(posterior, fit.parameters, at, found, decisions)
        counts = np.ones(len(scores))
    free_scores = np.concatenate([scores, hidden]) @ jacobian
    sizes = score_sizes(posterior, fit.parameters, at.solution.q, found.by_q)
    counts = np.concatenate([counts, observations.hidden.count])
    observed = -vector_hessian(assumed.belief, hessian, at.gradient, fit.parameters)
    scaling = free_scaling(posterior, fit.parameters, jacobian)
    if scaling is not None:
        # Rounding, and an inexact maximum, leave something along it.
        unit = scaling / np.linalg.norm(scaling)
        across = np.eye(len(unit)) - np.outer(unit, unit)
        observed = across @ observed @ across
    return Information(
        names=free_names(problem, fit.parameters, jacobian),
        observed=observed,
        outer_product=(free_scores * counts[:, None]).T @ free_scores,
        gradient=assumed.belief.pull_back(at.gradient, fit.parameters),
        score_sizes=np.max(np.abs(jacobian) * sizes[:, None], axis=0),
        n_decisions=float(counts.sum()),
        converged=fit.converged or bool(fit.undetermined),
        gauge=free_gauge(problem, fit.parameters, jacobian),
        parameters=fit.parameters,
        jacobian=jacobian,
        key=taken_transitions(problem.mdp, decisions),
        scores=free_scores,
        idle=np.any(np.abs(idle_weights(posterior, fit.parameters, at)) > TOUCHED, axis=0),
    )


def require_information(information: object) -> None:
    """SerdError unless an argument is an `Information`."""
    example = "fit_information(problem, decisions, fit)"
    require_kind("information", information, (Information,), example)


def _scores_of_timed(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    found: Sensitivities,
    decisions: TimedDecisions,
) -> FloatArray:
    """(n, blocks) scores of each decision whose action is known."""
    mdp, dwells = posterior.problem.mdp, posterior.observations.dwells
    truth = parameters.place(Block.TRUTH)
    scores = np.zeros((len(decisions), len(parameters.vector)))
    shown = ~decisions.hidden
    state, action = decisions.state[shown], decisions.action[shown]
    scores[shown] = choice_scores(posterior, parameters, at, found, state, action)
    ended = np.flatnonzero(shown & ~decisions.censored)
    key = taken_transitions(mdp, decisions.select(ended))
    scores[ended, truth] += outcome_scores(mdp.transitions, parameters.truth, key)
    if dwells is not None:
        scores[dwells.row, truth] += dwells.scores(parameters.truth)
    return scores[shown]


def _require_fitting(problem: Problem, fit: FitResult) -> None:
    at = fit.parameters
    for name, found, wanted in (
        ("reward weights", len(at.reward), len(problem.feature_names)),
        ("dynamics parameters", len(at.truth), problem.mdp.transitions.n_parameters),
    ):
        if found != wanted:
            raise SerdError(
                f"fit must have {wanted} {name} as the problem does, got {found}; pass the problem"
                " it was made with"
            )


#: Eigenvalues below this share of the largest count as zero.
NULL_SHARE = 1e-9
#: Eigenvalues below minus this share of the largest are negative beyond rounding.
NEGATIVE_SHARE = 1e-6
#: Share of the largest part of a null direction below which others are not named.
SMALL_PART = 0.1

# Share of the squared size of what was subtracted below which information is rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Spectrum:
    """m = n - g directions of n free numbers.

    values: (m,) eigenvalues of the correlation form, ascending; known, null: (m,) whether the data
    hold information along each.
    loadings: (m, n) each number's part, in standard errors it would have alone.
    directions: (m, n) the same in the numbers' own units, orthogonal to the gauge.
    """

    values: FloatArray
    loadings: FloatArray
    directions: FloatArray

    @property
    def null(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(m,) directions without information."""
        largest = max(float(self.values[-1]), np.finfo(np.float64).tiny)
        return np.asarray(self.values <= NULL_SHARE * largest)

    @property
    def covariance(self) -> FloatArray:
        """(n, n) inverse of the matrix on the directions that are not null."""
        known = self.directions[~self.null]
        return np.asarray((known.T / self.values[~self.null]) @ known)


def spectrum(information: Information, matrix: FloatArray) -> Spectrum:
    """Directions of one of the information matrices, or of another over the same numbers."""
    n_free = len(information.names)
    chosen = float_array("matrix", matrix, (n_free, n_free))
    scale = _scale(information, chosen)
    basis = gauge_free_basis(information.gauge / scale)
    correlation = chosen * scale[:, None] * scale
    values, vectors = np.linalg.eigh(basis.T @ correlation @ basis)
    loadings = (basis @ vectors).T
    gauge = information.gauge
    own_units = loadings * scale
    return Spectrum(values, loadings, own_units - own_units @ gauge.T @ gauge)


def _scale(information: Information, matrix: FloatArray) -> FloatArray:
    """(n,) D: the error each number would have if all others were known."""
    most = information.n_decisions * information.score_sizes**2
    own = np.abs(np.diag(matrix))
    squares = np.where(own > _ROUNDING * most, own, most)
    return np.asarray(1.0 / np.sqrt(np.where(squares > 0, squares, 1.0)))


@dataclass(frozen=True, eq=False)
class NullDirection:
    """A direction without information: its eigenvalue and what moves along it, largest first.

    loadings: in the standard errors that each number would have if the others were known.
    """

    eigenvalue: float
    loadings: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        parts = [f"{weight:+.2f} {name}" for name, weight in self.loadings]
        return " ".join(parts)


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What decisions determine; eigenvalues: of the correlation form without the gauge, ascending;
    null: directions that they do not determine.
    """

    eigenvalues: FloatArray
    null: tuple[NullDirection, ...]

    @property
    def identified(self) -> bool:
        """Whether the data determine every free number."""
        return not self.null


def identifiability(information: Information) -> Identifiability:
    """Find the combinations of numbers that the decisions of a fit do not determine.

    By the outer product, which has no prior in it.

        print(sc.identifiability(sc.fit_information(problem, decisions, fit)).null)
    """
    require_information(information)
    found, null = spectrum(information, information.outer_product), []
    for value, parts in zip(found.values[found.null], found.loadings[found.null], strict=True):
        order = np.argsort(-np.abs(parts), kind="stable")
        large = order[np.abs(parts[order]) >= SMALL_PART * np.abs(parts).max()]
        loadings = tuple((information.names[i], float(parts[i])) for i in large)
        null.append(NullDirection(float(value), loadings))
    return Identifiability(eigenvalues=found.values, null=tuple(null))


#: Longest Newton step, in standard errors, of a point that counts as an optimum.
LONGEST_STEP = 0.1
#: Eigenvalue of the correlation form of the information below which weights are not determined.
SINGULAR = 1e-12


def standard_errors(
    problem: Problem,
    information: Information,
    matrix: FloatArray | None = None,
    *,
    meat: FloatArray | None = None,
    require_optimum: bool = True,
) -> StandardErrors:
    """Compute standard errors of rewards and dynamics of a fit, jointly.

    matrix: `information.observed`, the default, or `information.outer_product`, (n, n).
    meat: (n, n) sum of the outer products of scores, for the sandwich with `matrix` around it:
    `information.outer_product`, or that of `clustered_outer_product`.
    require_optimum: SerdError where the fit did not converge or the gradient is not 0 there.

        errors = sc.standard_errors(problem, sc.fit_information(problem, decisions, fit))
        print(errors.reward, errors.reward_interval(fit.reward_weights))
    """
    require_problem(problem)
    require_information(information)
    matrix = information.observed if matrix is None else matrix
    found = spectrum(information, matrix)
    if found.values[0] < -NEGATIVE_SHARE * abs(found.values[-1]):
        raise SerdError(
            "the information matrix must not have negative eigenvalues, got"
            f" {found.values[0]}: the fit is no maximum; continue it until it has converged"
        )
    if require_optimum:
        _require_optimum(information, found)
    at, model = information.parameters, problem.mdp.transitions
    moved = {block: information.jacobian[at.place(block)] for block in Block}
    shape = model.moves.local_probabilities(at.truth).shape
    truth = model.moves.local_jacobian(at.truth) @ moved[Block.TRUTH]
    belief = model.moves.local_jacobian(at.belief) @ moved[Block.BELIEF]
    covariance = found.covariance
    if meat is not None:
        meat = float_array("meat", meat, covariance.shape)
        covariance = covariance @ meat @ covariance
    idle = information.idle @ np.abs(moved[Block.REWARD]) > 0
    return StandardErrors(
        names=information.names,
        free=np.where(idle, np.inf, _errors(np.eye(len(matrix)), found, meat)),
        covariance=covariance,
        reward=np.where(information.idle, np.inf, _errors(moved[Block.REWARD], found, meat)),
        outcome_probabilities=_errors(truth, found, meat).reshape(shape),
        believed_outcome_probabilities=_errors(belief, found, meat).reshape(shape),
    )


def _require_optimum(information: Information, found: Spectrum) -> None:
    gradient = information.gradient
    step = float(np.sqrt(gradient @ found.covariance @ gradient))
    if information.converged and step <= LONGEST_STEP:
        return
    state = "converged" if information.converged else "not converged"
    raise SerdError(
        f"the fit must have converged to where the Newton step is at most {LONGEST_STEP} standard"
        f" errors long, got {state} and {step:.3g}; continue the fit (at a kink of the objective"
        " there are no standard errors), or pass require_optimum=False"
    )


def _errors(rows: FloatArray, found: Spectrum, meat: FloatArray | None) -> FloatArray:
    """Standard error of each linear combination of the free numbers."""
    moves = rows @ found.directions.T
    total = np.linalg.norm(moves, axis=1)
    touched = np.linalg.norm(moves[:, found.null], axis=1) > TOUCHED * total
    by_value = moves[:, ~found.null] / found.values[~found.null]
    variance = np.sum(moves[:, ~found.null] * by_value, axis=1)
    if meat is not None:
        influence = by_value @ found.directions[~found.null]
        variance = np.maximum(np.sum((influence @ meat) * influence, axis=1), 0.0)
    return np.where(touched, np.inf, np.sqrt(variance))


def covariance_of(information: FloatArray) -> FloatArray:
    """(F, F) inverse by the correlation form; infinite in all entries where that is singular."""
    size = np.diag(information)
    if np.all(size > 0):
        scale = np.outer(1.0 / np.sqrt(size), 1.0 / np.sqrt(size))
        correlation = information * scale
        if np.linalg.eigvalsh(correlation)[0] > SINGULAR:
            return np.asarray(np.linalg.inv(correlation) * scale)
    return np.full_like(information, np.inf)
