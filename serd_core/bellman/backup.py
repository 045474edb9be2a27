"""One application of a Bellman operator: T V and what comes with it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.equations import BellmanEquation
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp

#: Values beyond overflow in sums and differences.
LARGEST_VALUE = 1e300
EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class BellmanProblem:
    """Everything T depends on: the equation, (S, A) rewards, transitions, and their MDP."""

    equation: BellmanEquation
    rewards: FloatArray
    transitions: Transitions
    mdp: Mdp

    def __post_init__(self) -> None:
        available = self.mdp.available
        allowed = np.where(available, self.rewards, 0.0)
        largest = LARGEST_VALUE * (1.0 - self.discount)
        if not max(float(allowed.max()), -float(allowed.min())) <= largest:
            state, action = np.argwhere(~(np.abs(allowed) <= largest))[0]
            raise SerdError(
                f"rewards[{state}, {action}] must be finite and at most {largest:.3g} in size, got"
                f" {allowed[state, action]}; use smaller weights or features, and mark forbidden"
                " actions unavailable"
            )
        object.__setattr__(self, "rewards", np.where(available, self.rewards, -np.inf))

    @property
    def discount(self) -> float:
        """gamma."""
        return self.mdp.discount

    def q(self, value: FloatArray) -> FloatArray:
        """(S, A) R + gamma P V, -inf where an action is unavailable."""
        return self.transitions.backed_up(self.rewards, self.discount, value)


@dataclass(frozen=True, eq=False)
class Backup:
    """T V at one V: (S, A) q, (S,) target = T V, gap = T V - V, and the largest |gap|."""

    q: FloatArray
    target: FloatArray
    gap: FloatArray
    residual: float

    @cached_property
    def scale(self) -> float:
        """max(1, max |T V|): what sizes and accuracies of values are relative to."""
        return max(1.0, float(self.target.max()), -float(self.target.min()))


def backup(problem: BellmanProblem, value: FloatArray) -> Backup:
    """Apply the Bellman operator once."""
    q = problem.q(value)
    target = problem.equation.maximum(q)
    gap = target - value
    return Backup(q=q, target=target, gap=gap, residual=max(float(gap.max()), -float(gap.min())))


def backup_rounding(problem: BellmanProblem, last: Backup) -> float:
    """Bound of |computed T V - T V|, for K transitions in the longest row and A actions.

    With the unit u = eps / 2: a row of P V, its discount and reward cost (K + 2) u max |V|, the
    sum of exponentials (A + log A + 4) u, and adding its logarithm u max |V|. Actions far below the
    best one have large errors in Q, and a weight that makes up for them.
    """
    largest_value = last.scale + last.residual
    n_terms = problem.transitions.model.longest_row + problem.transitions.model.n_actions + 3
    return n_terms * EPSILON * largest_value
