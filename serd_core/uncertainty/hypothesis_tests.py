"""Tests between fits by maximum likelihood, without priors.

Likelihood ratio: 2 (L1 - L0) of nested models is chi-squared with one degree of freedom per
restriction (Wilks, Annals of Mathematical Statistics 9, 1938).
Score: g^T I^-1 g with the gradient g and the information I of the larger model at the restricted
maximum has the same distribution; the larger model need not be fitted (Rao, 1948).
Vuong: sum m_i / (sqrt(n) sd(m)) of the differences m_i between the log-likelihoods of two models
that are not nested is normal where they are equally near the truth (Econometrica 57, 1989); where
it is positive, the first is nearer.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy  # loads stats at its first use

from serd_core.arrays import first_index, weighted_counts
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.problem import Problem
from serd_core.posterior.parameters import Block
from serd_core.priors.prior import UniformPrior
from serd_core.selection.evaluation import decision_log_likelihoods
from serd_core.uncertainty.identifiability import spectrum
from serd_core.uncertainty.information import fit_information

#: Standard deviation of the differences, relative to their size, that is nothing but rounding.
ROUNDING = 1e-9
#: Loss of log-likelihood, relative to its size, that incomplete convergence explains.
LOSS = 1e-6


@dataclass(frozen=True)
class HypothesisTest:
    """A statistic, its degrees of freedom (None for the normal distribution) and p-value."""

    statistic: float
    degrees_of_freedom: int | None
    p_value: float


def likelihood_ratio_test(
    restricted: FitResult, full: FitResult, n_restrictions: int | None = None
) -> HypothesisTest:
    """Of a fit against one that is free in more numbers.

    n_restrictions: None for the number of features that the restricted fit has less.
    """
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
    return _chi_squared(max(0.0, 2.0 * gain), number)


def score_test(problem: Problem, decisions: Decisions, restricted: FitResult) -> HypothesisTest:
    """Whether features of `problem` that the restricted fit has not would improve it.

    problem: has the features of the fit by name, and more; its MDP is that of the fit. Degrees of
    freedom are the added features less the null directions.
    """
    _require_likelihood(restricted)
    missing = [name for name in restricted.feature_names if name not in problem.feature_names]
    added = len(problem.feature_names) - len(restricted.feature_names)
    if missing or added < 1:
        raise SerdError(
            "problem must have every feature of the restricted fit and more, got"
            f" {problem.feature_names}; add features to test"
        )
    weights = np.zeros(len(problem.feature_names))
    places = [problem.feature_names.index(name) for name in restricted.feature_names]
    weights[places] = restricted.reward_weights
    wider = replace(
        restricted,
        feature_names=problem.feature_names,
        parameters=restricted.parameters.with_block(Block.REWARD, weights),
    )
    information = fit_information(problem, decisions, wider)
    found = spectrum(information, information.observed)
    if found.indefinite:
        raise SerdError(
            "the information matrix must not have negative eigenvalues, got"
            f" {found.values[0]}; fit the larger model and use likelihood_ratio_test"
        )
    number = added - int(found.null.sum())
    if number < 1:
        raise SerdError(
            f"decisions must determine an added feature, got {added} added and"
            f" {added - number} null directions; add features that are not collinear with others"
        )
    statistic = float(information.gradient @ found.covariance @ information.gradient)
    return _chi_squared(statistic, number)


def vuong_test(
    decisions: Decisions,
    first: tuple[Problem, FitResult],
    second: tuple[Problem, FitResult],
    *,
    by_episode: bool = True,
) -> HypothesisTest:
    """Which of two models that are not nested is nearer the truth; positive favours the first.

    by_episode: sums of episodes are independent of each other, their decisions may not be.
    """
    _require_likelihood(first[1], second[1])
    first_log, second_log = (
        decision_log_likelihoods(problem, decisions, fit) for problem, fit in (first, second)
    )
    for name, log in (("first", first_log), ("second", second_log)):
        if (bad := first_index(~np.isfinite(log))) is not None:
            raise SerdError(
                f"decisions must be possible under both models, got decision {bad[0]} with a"
                f" log-likelihood of {log[bad]} under the {name}; drop it or the model"
            )
    each = first_log - second_log
    if by_episode:
        _, episode = np.unique(decisions.episode, return_inverse=True)
        each = weighted_counts(episode, each, int(episode.max()) + 1)
    spread = float(np.std(each))
    if len(each) < 2 or not spread > ROUNDING * (1.0 + float(np.abs(first_log).mean())):
        raise SerdError(
            f"the models must differ in what they predict of at least 2 episodes, got {len(each)}"
            f" with a standard deviation of {spread}; use likelihood_ratio_test for nested ones"
        )
    statistic = float(np.sum(each) / (np.sqrt(len(each)) * spread))
    return HypothesisTest(statistic, None, float(2.0 * scipy.stats.norm.sf(abs(statistic))))


def _chi_squared(statistic: float, number: int) -> HypothesisTest:
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
