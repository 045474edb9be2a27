"""Test between nested fits by maximum likelihood, without priors.

The likelihood ratio 2 (L1 - L0) of nested models is chi-squared with one degree of freedom per
restriction (Wilks, Annals of Mathematical Statistics 9, 1938).
"""

from dataclasses import dataclass

import scipy  # loads stats at its first use

from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult, require_fit
from serd_core.priors.prior import UniformPrior

#: Loss of log-likelihood, relative to its size, that incomplete convergence explains.
LOSS = 1e-6


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
    _require_likelihood(restricted, full)
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
    most = _log_likelihood(full)
    gain = most - _log_likelihood(restricted)
    if not gain >= -LOSS * (1.0 + abs(most)):
        raise SerdError(
            f"full must be at least as likely as restricted, got a gain of {gain}; swap them if"
            " full is the smaller model"
        )
    statistic = max(0.0, 2.0 * gain)
    return HypothesisTest(statistic, number, float(scipy.stats.chi2.sf(statistic, number)))


def _log_likelihood(fit: FitResult) -> float:
    return fit.policy_log_likelihood + fit.dynamics_log_likelihood + fit.hidden_log_likelihood


def _require_likelihood(*fits: FitResult) -> None:
    for fit in fits:
        own = fit.assumptions
        if own is None:
            raise SerdError(
                "a test of likelihoods must have fits that record what they assumed, got"
                " assumptions=None; fit again"
            )
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
