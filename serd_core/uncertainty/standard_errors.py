"""Standard errors and confidence intervals of rewards and dynamics, jointly.

The covariance is the inverse of an information matrix with the gauge taken out; outcome
probabilities get theirs by the delta method, which does not depend on the gauge. A parameter that
a null direction moves has an infinite standard error: the data say nothing about it.
"""

from dataclasses import dataclass

import numpy as np
import scipy.special
import scipy.stats

from serd_core.arrays import FloatArray, first_index
from serd_core.errors import SerdError
from serd_core.parameters import Block
from serd_core.problem import Problem
from serd_core.uncertainty.identifiability import NULL_SHARE, gauge_free_basis
from serd_core.uncertainty.information import Information

#: Part of a null direction below which a parameter counts as not moved by it.
TOUCHED = 1e-6


@dataclass(frozen=True, eq=False)
class StandardErrors:
    """Standard errors; infinite where the data do not identify a number.

    free: (n,) of the free numbers, named by `names`; covariance: (n, n) over what is identified.
    reward: (F,); outcome_probabilities: (M, K) of the true dynamics.
    """

    names: tuple[str, ...]
    free: FloatArray
    covariance: FloatArray
    reward: FloatArray
    outcome_probabilities: FloatArray


def standard_errors(
    problem: Problem, information: Information, matrix: FloatArray, null_share: float = NULL_SHARE
) -> StandardErrors:
    """From one of `information.observed` and `information.outer_product`."""
    basis = gauge_free_basis(information)
    values, vectors = np.linalg.eigh(basis.T @ matrix @ basis)
    if values[0] < -1e-6 * abs(values[-1]):
        raise SerdError(
            "the information matrix must not have negative eigenvalues, got"
            f" {values[0]}: the fit is no maximum; continue it until it has converged"
        )
    null = values <= null_share * max(float(values[-1]), np.finfo(np.float64).tiny)
    directions = basis @ vectors
    known = directions[:, ~null]
    covariance = (known / values[~null]) @ known.T
    to_blocks = information.jacobian
    to_local = _local_jacobian(problem, information)
    return StandardErrors(
        names=information.names,
        free=_errors(np.eye(len(matrix)), covariance, directions[:, null]),
        covariance=covariance,
        reward=_errors(
            to_blocks[information.parameters.place(Block.REWARD)], covariance, directions[:, null]
        ),
        outcome_probabilities=_errors(to_local, covariance, directions[:, null]).reshape(
            problem.mdp.transitions.local_probabilities(information.parameters.truth).shape
        ),
    )


def confidence_interval(
    estimate: FloatArray, errors: FloatArray, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Normal (Wald) interval; approximate, as it relies on many decisions.

    For numbers of any size such as reward weights; see `probability_interval`.
    """
    width = _normal_quantile(coverage) * np.asarray(errors)
    return np.asarray(estimate) - width, np.asarray(estimate) + width


def probability_interval(
    estimate: FloatArray, errors: FloatArray, coverage: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Normal interval of the log-odds, which stays within 0 and 1: logit p +- z e / (p (1 - p)).

    [0, 1] where the error is infinite, or not 0 for an estimate of 0 or 1, which has no log-odds.
    """
    probability, error = np.asarray(estimate, np.float64), np.asarray(errors, np.float64)
    bad = first_index(~((probability >= 0.0) & (probability <= 1.0)))
    if bad is not None:
        raise SerdError(
            f"estimate{list(bad)} must be a probability, got {probability[bad]}"
            "; use confidence_interval for other numbers"
        )
    spread = probability * (1.0 - probability)
    width = np.divide(error, spread, out=np.full(error.shape, np.inf), where=spread > 0)
    width = _normal_quantile(coverage) * np.where(error == 0.0, 0.0, width)
    odds = scipy.special.logit(probability)
    known, settled = np.isfinite(width), error == 0.0
    reached = np.where(known, width, 0.0)
    lower = np.where(known, scipy.special.expit(odds - reached), 0.0)
    upper = np.where(known, scipy.special.expit(odds + reached), 1.0)
    return np.where(settled, probability, lower), np.where(settled, probability, upper)


def _normal_quantile(coverage: float) -> float:
    if not 0.0 < coverage < 1.0:
        raise SerdError(f"coverage must be between 0 and 1, got {coverage}; use 0.95")
    return float(scipy.stats.norm.ppf(0.5 + coverage / 2.0))


def _local_jacobian(problem: Problem, information: Information) -> FloatArray:
    truth = information.parameters.truth
    moved = information.jacobian[information.parameters.place(Block.TRUTH)]
    return np.asarray(problem.mdp.transitions.local_jacobian(truth) @ moved)


def _errors(rows: FloatArray, covariance: FloatArray, null: FloatArray) -> FloatArray:
    """Standard error of each linear combination of the free numbers."""
    variance = np.einsum("ij,jk,ik->i", rows, covariance, rows)
    touched = np.linalg.norm(rows @ null, axis=1) > TOUCHED * np.linalg.norm(rows, axis=1)
    return np.where(touched, np.inf, np.sqrt(np.maximum(variance, 0.0)))
