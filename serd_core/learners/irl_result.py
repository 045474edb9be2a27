"""What learners of reward weights alone hand back."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AscentResult
from serd_core.bellman.solution import BellmanSolution


@dataclass(frozen=True, eq=False)
class IrlResult:
    """Reward weights under given dynamics, and how the fit went.

    reward_weights: (F,); objective: what the learner maximised, per its own docstring.
    outcome_probabilities: (M, K), or the entries of a SparseModel.
    gradient_norm: largest entry of its gradient; converged: that norm is within the tolerance.
    inverse_temperature: of the Boltzmann policy the weights were fitted with, None for a soft one.
    residual, error_bound: certificate of the last Bellman solve (`BellmanSolution`), NaN where the
    learner solves none or keeps no record of it.
    """

    feature_names: tuple[str, ...]
    reward_weights: FloatArray
    outcome_probabilities: FloatArray
    objective: float
    gradient_norm: float
    n_steps: int
    n_evaluations: int
    converged: bool
    message: str
    objective_trace: FloatArray
    inverse_temperature: float | None = None
    residual: float = np.nan
    error_bound: float = np.nan


def irl_result(
    feature_names: tuple[str, ...],
    outcome_probabilities: FloatArray,
    ascended: AscentResult,
    *,
    solution: BellmanSolution | None = None,
    inverse_temperature: float | None = None,
) -> IrlResult:
    """Record of an ascent over the reward weights.

    solution: the last inner solve, where there is one.
    """
    return IrlResult(
        feature_names=feature_names,
        reward_weights=ascended.vector,
        outcome_probabilities=outcome_probabilities,
        objective=ascended.objective,
        gradient_norm=ascended.gradient_norm,
        n_steps=ascended.n_steps,
        n_evaluations=ascended.n_evaluations,
        converged=ascended.converged and (solution is None or solution.converged),
        message=ascended.message,
        objective_trace=ascended.objective_trace,
        inverse_temperature=inverse_temperature,
        residual=np.nan if solution is None else solution.residual,
        error_bound=np.nan if solution is None else solution.error_bound,
    )
