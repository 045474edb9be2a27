"""Inference beyond the curvature of one fit: clusters, the bootstrap and tests of nested models.

The bootstrap draws episodes with replacement, as decisions within one depend on each other (Efron
and Tibshirani 1993). Nested fits without priors are compared by the likelihood ratio 2 (L1 - L0),
which is chi-squared with one degree of freedom per restriction (Wilks 1938).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from serd_core import checks
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, TimedDecisions, require_decisions
from serd_core.demonstrations.observations import taken_transitions
from serd_core.display import Record
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.mdp.problem import Problem, require_problem
from serd_core.priors.prior import UniformPrior
from serd_core.uncertainty.standard_errors import Information, require_information


def clustered_outer_product(
    problem: Problem,
    information: Information,
    decisions: Decisions,
    clusters: IntArray | None = None,
) -> FloatArray:
    """Sum scores over clusters, for standard errors of decisions that depend on each other.

    clusters: (N,) of each decision; None for episodes. Returns the (n, n) sum over clusters of the
    outer product of the sum of their scores, with the factor C / (C - 1) of C clusters (Cameron and
    Miller, Journal of Human Resources 50, 2015); it is the argument `meat` of `standard_errors`.
    SerdError where actions are hidden, or decisions are not those of the information.

        information = sc.fit_information(problem, decisions, fit)
        by_episode = sc.clustered_outer_product(problem, information, decisions)
        errors = sc.standard_errors(problem, information, meat=by_episode)
    """
    require_problem(problem)
    require_information(information)
    require_decisions(decisions)
    given = decisions.episode if clusters is None else clusters
    labels = checks.int_array("clusters", given, (len(decisions),))
    names, cluster = np.unique(labels, return_inverse=True)
    checks.require_count("the number of clusters", len(names), 2, "more episodes")
    key, n_hidden = taken_transitions(problem.mdp, decisions), int(decisions.hidden.sum())
    if n_hidden or not np.array_equal(key, information.key):
        raise SerdError(
            "decisions must be those of the information, and show their actions, got"
            f" {len(decisions)} with {n_hidden} hidden actions; pass the decisions of"
            " fit_information, or use bootstrap where actions are hidden"
        )
    scores = information.scores
    if not isinstance(decisions, TimedDecisions):
        scores = scores[np.unique(key, return_inverse=True)[1]]
    sums = np.zeros((len(names), len(information.names)))
    np.add.at(sums, cluster, scores)
    return np.asarray(len(names) / (len(names) - 1.0) * (sums.T @ sums))


@dataclass(frozen=True, eq=False, repr=False)
class Bootstrap(Record):
    """The (n, ...) estimates of resampled decisions, with their spread."""

    estimates: FloatArray

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviation of the estimates."""
        return np.asarray(self.estimates.std(axis=0, ddof=1))

    def interval(self, coverage: float = 0.95) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of the percentile intervals."""
        checks.require_share("coverage", coverage)
        low, high = np.quantile(self.estimates, [0.5 - coverage / 2, 0.5 + coverage / 2], axis=0)
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
    checks.require_generator(rng)
    require_decisions(decisions)
    checks.require_count("n", n, 2, "200")
    checks.require_count("the number of episodes", len(decisions.episodes), 2, "more decisions")
    order = np.argsort(decisions.episode, kind="stable")
    rows = np.split(order, np.flatnonzero(np.diff(decisions.episode[order])) + 1)
    estimates = []
    for drawn in rng.integers(len(rows), size=(n, len(rows))):
        chosen = [rows[place] for place in drawn]
        # An episode that is drawn twice is two.
        episode = np.repeat(np.arange(len(chosen)), [len(each) for each in chosen])
        sample = decisions.select(np.concatenate(chosen))
        estimates.append(estimate(replace(sample, episode=episode)))
    name, fix = "what estimate returns", "estimate what every sample of the episodes determines"
    found = np.asarray(checks.number_array(name, estimates), dtype=np.float64)
    checks.require_each(name, found, ~np.isnan(found), "be a number for every sample", fix)
    return Bootstrap(found)


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
    for name, fit in (("restricted", restricted), ("full", full)):
        own = fit.assumed
        priors = [p for p in (own.prior, own.belief.prior) if not isinstance(p, UniformPrior)]
        if priors or not (own.by_likelihood and fit.converged):
            raise SerdError(
                f"{name} must be a fit that converged and maximised the likelihood without a prior,"
                f" got converged={fit.converged}, by_likelihood={own.by_likelihood} and priors"
                f" {priors}; use fit_mdce_irl_by_likelihood, or fit_mdce_serd with"
                " prior=UniformPrior()"
            )
    if restricted.n_decisions != full.n_decisions:
        raise SerdError(
            "restricted and full must be fits of the same decisions, got"
            f" {restricted.n_decisions} and {full.n_decisions} decisions; fit both to all of them"
        )
    less = len(full.reward_weights) - len(restricted.reward_weights)
    number = less if n_restrictions is None else n_restrictions
    checks.require_count("n_restrictions", number, 1, "the larger model as full")
    less_likely, most = (
        fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.hidden_log_likelihood
        for fit in (restricted, full)
    )
    gain = most - less_likely
    # Incomplete convergence explains a small loss.
    if not gain >= -1e-6 * (1.0 + abs(most)):
        raise SerdError(
            f"full must be at least as likely as restricted, got a gain of {gain}; swap them if"
            " full is the smaller model"
        )
    statistic = max(0.0, 2.0 * gain)
    return HypothesisTest(statistic, number, float(chdtrc(number, statistic)))
