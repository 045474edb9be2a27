"""What learners of reward weights alone hand back."""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import AscentResult


@dataclass(frozen=True, eq=False)
class IrlResult:
    """Reward weights under given dynamics, and how the fit went.

    reward_weights: (F,); objective: what the learner maximised, per its own docstring.
    gradient_norm: largest entry of its gradient; converged: that norm is within the tolerance.
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


def irl_result(
    feature_names: tuple[str, ...],
    outcome_probabilities: FloatArray,
    ascended: AscentResult,
    *,
    solved: bool = True,
) -> IrlResult:
    """Record of an ascent over the reward weights; `solved`: the last inner solve converged."""
    return IrlResult(
        feature_names=feature_names,
        reward_weights=ascended.vector,
        outcome_probabilities=outcome_probabilities,
        objective=ascended.objective,
        gradient_norm=ascended.gradient_norm,
        n_steps=ascended.n_steps,
        n_evaluations=ascended.n_evaluations,
        converged=ascended.converged and solved,
        message=ascended.message,
        objective_trace=ascended.objective_trace,
    )
