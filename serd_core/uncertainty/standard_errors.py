"""Standard errors and confidence intervals of rewards and dynamics, jointly.

The covariance is the inverse of an information matrix with the gauge taken out; outcome
probabilities get theirs by the delta method, which does not depend on the gauge. A parameter that
a null direction moves has an infinite standard error: the data do not determine it.

All this holds at an optimum where J is smooth: there the gradient g is 0. Elsewhere, as on the way
to it or at a kink, the Newton step M^-1 g leads away from the point, by sqrt(g . M^-1 g) standard
errors at most in any direction, and standard errors computed there mean little.
"""

from dataclasses import dataclass

import numpy as np
import scipy.special
import scipy.stats

from serd_core.arrays import FloatArray
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.posterior.parameters import Block
from serd_core.uncertainty.identifiability import NULL_SHARE, Spectrum, spectrum
from serd_core.uncertainty.information import Information

#: Part of a null direction below which a parameter counts as not moved by it.
TOUCHED = 1e-6

#: Longest Newton step, in standard errors, of a point that counts as an optimum.
LONGEST_STEP = 0.1


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


def standard_errors(
    problem: Problem,
    information: Information,
    matrix: FloatArray,
    null_share: float = NULL_SHARE,
    *,
    require_optimum: bool = True,
) -> StandardErrors:
    """From one of `information.observed` and `information.outer_product`.

    require_optimum: SerdError where the fit did not converge or the gradient is not 0 there.
    """
    found = spectrum(information, matrix, null_share)
    if found.values[0] < -1e-6 * abs(found.values[-1]):
        raise SerdError(
            "the information matrix must not have negative eigenvalues, got"
            f" {found.values[0]}: the fit is no maximum; continue it until it has converged"
        )
    if require_optimum:
        _require_optimum(information, found)
    at, model = information.parameters, problem.mdp.transitions
    moved = {block: information.jacobian[at.place(block)] for block in Block}
    shape = model.local_probabilities(at.truth).shape
    truth = model.local_jacobian(at.truth) @ moved[Block.TRUTH]
    belief = model.local_jacobian(at.belief) @ moved[Block.BELIEF]
    return StandardErrors(
        names=information.names,
        free=_errors(np.eye(len(matrix)), found),
        covariance=found.covariance,
        reward=_errors(moved[Block.REWARD], found),
        outcome_probabilities=_errors(truth, found).reshape(shape),
        believed_outcome_probabilities=_errors(belief, found).reshape(shape),
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
    """Normal (Wald) interval of reward weights; approximate, as it relies on many decisions."""
    width = _normal_quantile(coverage) * np.asarray(errors)
    return np.asarray(estimate) - width, np.asarray(estimate) + width


def _normal_quantile(coverage: float) -> float:
    if not 0.0 < coverage < 1.0:
        raise SerdError(f"coverage must be between 0 and 1, got {coverage}; use 0.95")
    return float(scipy.stats.norm.ppf(0.5 + coverage / 2.0))


def _errors(rows: FloatArray, found: Spectrum) -> FloatArray:
    """Standard error of each linear combination of the free numbers."""
    moves = rows @ found.directions.T
    total = np.linalg.norm(moves, axis=1)
    touched = np.linalg.norm(moves[:, found.null], axis=1) > TOUCHED * total
    known = ~found.null
    variance = (moves[:, known] ** 2 / found.values[known]).sum(axis=1)
    return np.where(touched, np.inf, np.sqrt(variance))
