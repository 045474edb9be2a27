"""Standard errors, intervals and tests of rewards and dynamics, jointly.

The covariance is the inverse of an information matrix with the gauge taken out; outcome
probabilities get theirs by the delta method. A parameter that a null direction moves has an
infinite standard error. Where the model is wrong, or decisions of one episode depend on each other,
it is the sandwich A^-1 B A^-1 of the observed information A and the outer product B of the scores,
summed by decision (White 1982) or by cluster (Liang and Zeger 1986). All this holds where J is
smooth and its gradient 0.

The bootstrap draws episodes with replacement, as decisions within one depend on each other (Efron
and Tibshirani 1993). Nested fits without
priors are compared by the likelihood ratio 2 (L1 - L0), which is chi-squared with one degree of
freedom per restriction (Wilks 1938).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy  # loads special and stats at their first use

from serd_core.arrays import (
    FloatArray,
    IntArray,
    first_index,
    float_array,
    int_array,
    number_array,
    require_count,
    require_each,
    require_generator,
    require_share,
)
from serd_core.demonstrations.decisions import Decisions, require_decisions
from serd_core.demonstrations.observations import taken_transitions
from serd_core.dynamics.transition_model import places_of
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.problem import Problem, require_problem
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import UniformPrior
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_core.uncertainty.identifiability import Spectrum, spectrum
from serd_core.uncertainty.information import Information, require_information

#: Part of a null direction below which a parameter counts as not moved by it.
TOUCHED = 1e-6

#: Longest Newton step, in standard errors, of a point that counts as an optimum.
LONGEST_STEP = 0.1
#: Eigenvalue of the correlation form of the information below which weights are not determined.
SINGULAR = 1e-12
#: Loss of log-likelihood, relative to its size, that incomplete convergence explains.
LOSS = 1e-6


@dataclass(frozen=True, eq=False)
class StandardErrors:
    """Standard errors; infinite where the data do not identify a number.

    free: (n,) of the free numbers, named by `names`; covariance: (n, n) over what is identified.
    reward: (F,); outcome_probabilities: (M, K) of the true dynamics;
    believed_outcome_probabilities: (M, K) of the expert's belief.
    """

    names: tuple[str, ...]
    free: FloatArray
    covariance: FloatArray
    reward: FloatArray
    outcome_probabilities: FloatArray
    believed_outcome_probabilities: FloatArray

    def reward_interval(
        self, weights: FloatArray, coverage: float = 0.95
    ) -> tuple[FloatArray, FloatArray]:
        """Normal intervals of (F,) reward weights, see `confidence_interval`."""
        return confidence_interval(weights, self.reward, coverage)


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
    if found.indefinite:
        raise SerdError(
            "the information matrix must not have negative eigenvalues, got"
            f" {found.values[0]}: the fit is no maximum; continue it until it has converged"
        )
    if require_optimum:
        _require_optimum(information, found)
    at, model = information.parameters, problem.mdp.transitions
    moved = {block: information.jacobian[at.place(block)] for block in Block}
    shape = model.moves.local_probabilities(at.truth).shape
    spread, known = _spread(found, meat), found.directions[~found.null]
    truth = model.moves.local_jacobian(at.truth) @ moved[Block.TRUTH]
    belief = model.moves.local_jacobian(at.belief) @ moved[Block.BELIEF]
    return StandardErrors(
        names=information.names,
        free=_errors(np.eye(len(matrix)), found, spread),
        covariance=np.asarray(known.T @ spread @ known),
        reward=_errors(moved[Block.REWARD], found, spread),
        outcome_probabilities=_errors(truth, found, spread).reshape(shape),
        believed_outcome_probabilities=_errors(belief, found, spread).reshape(shape),
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


def confidence_interval(
    estimate: FloatArray, errors: FloatArray, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Compute the normal (Wald) interval of estimates; approximate, as it relies on many decisions.

    estimate, errors: (n,) numbers and their standard errors; coverage: share of such intervals that
    hold the truth. Returns the lower and the upper ends.
    """
    middle, table = number_array("estimate", estimate), number_array("errors", errors)
    if table.ndim and table.shape != middle.shape:
        raise SerdError(
            f"errors must have the shape of estimate, {middle.shape}, got {table.shape}; give one"
            " per number"
        )
    require_each("errors", table, ~(table < 0), "be at least 0", "give standard errors")
    require_share("coverage", coverage)
    width = float(scipy.stats.norm.ppf(0.5 + coverage / 2.0)) * table
    return middle - width, middle + width


def clustered_outer_product(
    problem: Problem,
    information: Information,
    decisions: Decisions,
    clusters: IntArray | None = None,
) -> FloatArray:
    """Sum scores over clusters, for standard errors of decisions that depend on each other.

    clusters: (N,) of each decision; None for episodes. Returns the (n, n) sum over clusters of the
    outer product of the sum of their scores, with the factor C / (C - 1) of C clusters (Cameron and
    Miller, Journal of Human Resources 50, 2015); it is the `meat` of `standard_errors`.
    """
    require_problem(problem)
    require_information(information)
    require_decisions(decisions)
    given = decisions.episode if clusters is None else clusters
    labels = int_array("clusters", given, (len(decisions),))
    names, cluster = np.unique(labels, return_inverse=True)
    if len(names) < 2:
        raise SerdError(f"clusters must be at least 2, got {len(names)}; record more episodes")
    if decisions.hidden.any():
        raise SerdError(
            "decisions must show their actions where scores are summed by cluster, got"
            f" {int(decisions.hidden.sum())} without; use bootstrap"
        )
    key = taken_transitions(problem.mdp, decisions)
    if isinstance(decisions, TimedDecisions):
        same = np.array_equal(key, information.key)
        place = np.arange(len(key)) if same else np.full(len(key), -1)
    else:
        place = places_of(key, information.key)
    if (bad := first_index(place < 0)) is not None:
        raise SerdError(
            f"decisions must be those of the information, got decision {bad[0]} with a transition"
            " that those have not; pass the decisions of fit_information"
        )
    sums = np.zeros((len(names), len(information.names)))
    np.add.at(sums, cluster, information.scores[place])
    return np.asarray(len(names) / (len(names) - 1.0) * (sums.T @ sums))


def _spread(found: Spectrum, meat: FloatArray | None) -> FloatArray:
    """(k, k) covariance along the k directions that are known."""
    known = ~found.null
    if meat is None:
        return np.diag(1.0 / found.values[known])
    inner = found.directions[known] / found.values[known][:, None]
    return np.asarray(inner @ float_array("meat", meat, (found.directions.shape[1],) * 2) @ inner.T)


def _errors(rows: FloatArray, found: Spectrum, spread: FloatArray) -> FloatArray:
    """Standard error of each linear combination of the free numbers."""
    moves = rows @ found.directions.T
    total = np.linalg.norm(moves, axis=1)
    touched = np.linalg.norm(moves[:, found.null], axis=1) > TOUCHED * total
    known = moves[:, ~found.null]
    variance = np.maximum(np.sum((known @ spread) * known, axis=1), 0.0)
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


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """The (n, ...) estimates of resampled decisions, with their spread."""

    estimates: FloatArray

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviation of the estimates."""
        return np.asarray(self.estimates.std(axis=0, ddof=1))

    def interval(self, coverage: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of the percentile intervals."""
        require_share("coverage", coverage)
        tails = np.array([(1.0 - coverage) / 2.0, (1.0 + coverage) / 2.0])
        low, high = np.quantile(self.estimates, tails, axis=0)
        return low, high


def bootstrap(
    decisions: Decisions,
    estimate: Callable[[Decisions], FloatArray],
    *,
    rng: np.random.Generator,
    n: int = 200,
) -> Bootstrap:
    """Estimate anew from n samples of as many episodes as there are, drawn with replacement.

    estimate: decisions -> numbers of one shape. SerdError where one is NaN.

        drawn = sc.bootstrap(decisions, lambda d: sc.estimate_dynamics(problem, d), rng=rng)
        print(drawn.standard_errors, drawn.interval(0.95))
    """
    require_generator(rng)
    require_decisions(decisions)
    require_count("n", n, 2, "200")
    episodes = decisions.episodes
    if len(episodes) < 2:
        raise SerdError(
            f"decisions must hold at least 2 episodes, got {len(episodes)}; record more of them"
        )
    order = np.argsort(decisions.episode, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(decisions.episode[order])) + 1)
    drawn = rng.integers(len(episodes), size=(n, len(episodes)))
    estimates = [estimate(_sample(decisions, rows, each)) for each in drawn]
    found = np.asarray(number_array("what estimate returns", estimates), dtype=np.float64)
    if (bad := first_index(np.isnan(found))) is not None:
        raise SerdError(
            f"estimate must return numbers for every sample, got NaN for sample {bad[0]} of {n};"
            " estimate what every sample of the episodes determines"
        )
    return Bootstrap(found)


def _sample(decisions: Decisions, rows: list[IntArray], drawn: IntArray) -> Decisions:
    """The drawn episodes, numbered anew, so that one drawn twice is two."""
    chosen = [rows[place] for place in drawn]
    episode = np.repeat(np.arange(len(chosen)), [len(each) for each in chosen])
    return replace(decisions.select(np.concatenate(chosen)), episode=episode)


@dataclass(frozen=True)
class HypothesisTest:
    """The result of a test: its statistic, degrees of freedom and p-value."""

    statistic: float
    degrees_of_freedom: int
    p_value: float


def likelihood_ratio_test(
    restricted: FitResult, full: FitResult, n_restrictions: int | None = None
) -> HypothesisTest:
    """Test a fit against one that is free in more numbers, by twice the gain in log-likelihood.

    n_restrictions: degrees of freedom; None for the number of features that the restricted fit has
    less. SerdError where a fit did not converge or is no fit by likelihood.

        fit = sc.fit_mdce_serd(problem, decisions, rng=rng, prior=sc.UniformPrior())
        print(sc.likelihood_ratio_test(fit_without_walls, fit).p_value)
    """
    require_fit(restricted, "restricted")
    require_fit(full, "full")
    for fit in (restricted, full):
        _require_likelihood(fit)
    if restricted.n_decisions != full.n_decisions:
        raise SerdError(
            "restricted and full must be fits of the same decisions, got"
            f" {restricted.n_decisions} and {full.n_decisions} decisions; fit both to all of them"
        )
    less = len(full.reward_weights) - len(restricted.reward_weights)
    number = less if n_restrictions is None else n_restrictions
    if number < 1:
        raise SerdError(
            f"n_restrictions must be at least 1, got {number}; pass the larger model as full, and"
            " n_restrictions where both have the same features"
        )
    less_likely, most = (
        fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.hidden_log_likelihood
        for fit in (restricted, full)
    )
    gain = most - less_likely
    if not gain >= -LOSS * (1.0 + abs(most)):
        raise SerdError(
            f"full must be at least as likely as restricted, got a gain of {gain}; swap them if"
            " full is the smaller model"
        )
    statistic = max(0.0, 2.0 * gain)
    return HypothesisTest(statistic, number, float(scipy.stats.chi2.sf(statistic, number)))


def _require_likelihood(fit: FitResult) -> None:
    own = fit.assumed
    if not own.by_likelihood:
        raise SerdError(
            "a test of likelihoods must have fits that maximised the likelihood, got one by"
            " another criterion; use fit_mdce_irl_by_likelihood, or fit_mdce_serd with"
            " prior=UniformPrior()"
        )
    proper = [
        prior for prior in (own.prior, own.belief.prior) if not isinstance(prior, UniformPrior)
    ]
    if proper or not fit.converged:
        state = "converged" if fit.converged else "not converged"
        raise SerdError(
            "a test of likelihoods must have fits that converged without a prior, got one that"
            f" is {state} with {proper or 'none'}; fit with prior=UniformPrior()"
        )
