"""One application of a Bellman operator: T V and what comes with it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from serd_core.arrays import FloatArray, unrepeated
from serd_core.bellman.engine import Engine
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
        if unrepeated(available).all():
            allowed = rewards = self.rewards
        else:
            allowed = np.where(available, self.rewards, 0.0)
            rewards = np.where(available, self.rewards, -np.inf)
        largest = LARGEST_VALUE * (1.0 - self.discount)
        once = unrepeated(allowed)
        if not max(float(once.max()), -float(once.min())) <= largest:
            state, action = np.argwhere(~(np.abs(allowed) <= largest))[0]
            raise SerdError(
                f"rewards[{state}, {action}] must be finite and at most {largest:.3g} in size, got"
                f" {allowed[state, action]}; use smaller weights or features, and mark forbidden"
                " actions unavailable"
            )
        object.__setattr__(self, "rewards", rewards)

    @property
    def discount(self) -> float:
        """gamma."""
        return self.mdp.discount

    def q(self, value: FloatArray) -> FloatArray:
        """(S, A) R + gamma P V, -inf where an action is unavailable."""
        return self.engine.q(self.transitions, self.rewards, self.discount, value)

    def settled(self, value: FloatArray, smallest: float) -> FloatArray:
        """(S,) the value after sweeps of the soft equation, until states move by less."""
        return self.engine.settled(self.transitions, self.rewards, self.discount, value, smallest)

    @property
    def engine(self) -> Engine:
        """Who applies T."""
        return self.mdp.engine


@dataclass(frozen=True, eq=False)
class Backup:
    """T V at one V: (S,) value = V, target = T V, and residual, the largest |T V - V|.

    kept_q: Q, or None where it is computed when it is asked for.
    """

    problem: BellmanProblem
    value: FloatArray
    target: FloatArray
    residual: float
    kept_q: FloatArray | None

    @property
    def q(self) -> FloatArray:
        """(S, A) Q-function of V."""
        return self.problem.q(self.value) if self.kept_q is None else self.kept_q

    @cached_property
    def gap(self) -> FloatArray:
        """(S,) T V - V."""
        return self.target - self.value

    @cached_property
    def scale(self) -> float:
        """max(1, max |T V|): what sizes and accuracies of values are relative to."""
        return max(1.0, float(self.target.max()), -float(self.target.min()))


def backup(problem: BellmanProblem, value: FloatArray) -> Backup:
    """Apply the Bellman operator once."""
    target, q = problem.engine.backup(
        problem.equation, problem.transitions, problem.rewards, problem.discount, value
    )
    gap = target - value
    residual = max(float(gap.max()), -float(gap.min()))
    return Backup(problem=problem, value=value, target=target, residual=residual, kept_q=q)


def backup_rounding(problem: BellmanProblem, last: Backup) -> float:
    """Bound of |computed T V - T V|, for K transitions in the longest row and A actions.

    With the unit u = eps / 2: a row of P V, its discount and reward cost (K + 2) u max |V|, the
    sum of exponentials (A + log A + 4) u, and adding its logarithm u max |V|. Actions far below the
    best one have large errors in Q, and a weight that makes up for them.
    """
    largest_value = last.scale + last.residual
    n_terms = problem.transitions.model.longest_row + problem.transitions.model.n_actions + 3
    return n_terms * EPSILON * largest_value
