"""What a learner hands to the study, whatever the learner."""

from dataclasses import dataclass
from typing import Any

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.navigation import NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.policies.solved_policy import optimal_policy
from serd_core.selection.evaluation import fitted_policy


@dataclass(frozen=True, eq=False)
class Learned:
    """policy: (S, A) what the expert is expected to do; greedy: (S,) what the robot will do.

    truth: (M, K) the dynamics; reward_weights: (F,), empty where none are learned.
    converged: whether every fit behind it did; prior_weight: what validation chose, or None.
    """

    policy: FloatArray
    greedy: IntArray
    truth: FloatArray
    reward_weights: FloatArray
    converged: bool
    prior_weight: float | None = None

    def values(self) -> dict[str, Any]:
        """What a model is kept as."""
        return {
            "greedy": self.greedy.tolist(),
            "truth": self.truth.tolist(),
            "reward_weights": self.reward_weights.tolist(),
        }


def learned_from_fit(
    problem: NavigationProblem, fit: FitResult, prior_weight: float | None = None
) -> Learned:
    """Actions are predicted by the belief, as the expert planned; the robot plans by the truth."""
    truth = fit.outcome_probabilities
    return Learned(
        policy=fitted_policy(problem, fit),
        greedy=optimal_policy(problem, fit.reward_weights, truth).greedy,
        truth=truth,
        reward_weights=fit.reward_weights,
        converged=fit.converged,
        prior_weight=prior_weight,
    )
