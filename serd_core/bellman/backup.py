"""One application of a Bellman operator: T V and what comes with it."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_core.bellman.equation import BellmanEquation
from serd_core.dynamics.transitions import Transitions
from serd_core.errors import SerdError


@dataclass(frozen=True, eq=False)
class BellmanProblem:
    """Everything T depends on: the equation, (S, A) rewards, transitions, discount and mask."""

    equation: BellmanEquation
    rewards: FloatArray
    transitions: Transitions
    discount: float
    available: BoolArray

    def __post_init__(self) -> None:
        allowed = np.where(self.available, self.rewards, 0.0)
        if not np.all(np.isfinite(allowed)):
            state, action = np.argwhere(~np.isfinite(allowed))[0]
            raise SerdError(
                f"rewards[{state}, {action}] must be finite, got {allowed[state, action]}"
                "; mark forbidden actions unavailable instead"
            )
        object.__setattr__(self, "rewards", np.where(self.available, self.rewards, -np.inf))

    def q(self, value: FloatArray) -> FloatArray:
        """(S, A) R + gamma P V, -inf where an action is unavailable."""
        return self.rewards + self.discount * self.transitions.expected(value)


@dataclass(frozen=True, eq=False)
class Backup:
    """T V at one V: (S, A) q, (S,) target = T V, gap = T V - V, and the largest |gap|."""

    q: FloatArray
    target: FloatArray
    gap: FloatArray
    residual: float


def backup(problem: BellmanProblem, value: FloatArray) -> Backup:
    """Apply the Bellman operator once."""
    q = problem.q(value)
    target = problem.equation.maximum(q)
    gap = target - value
    return Backup(q=q, target=target, gap=gap, residual=max(float(gap.max()), -float(gap.min())))
