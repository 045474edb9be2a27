"""The absorbing chain of a policy, and the arrival from each of its states (Fig. 5.10).

The chain P_pi[s, s'] = sum_a pi(a|s) P(s'|s,a) moves one decision at a time; what has reached a
goal state has arrived. Goals absorb under every policy. Since the chain has no memory, the arrival
from a state is the law of the remaining time given all that has happened so far.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, IntArray, chosen_indices
from serd_core.dynamics.transition_model import transitions_of
from serd_core.mdp.mdp import Mdp, checked_policy
from serd_core.mdp.problem import require_problem


class GoalProblem(Protocol):
    """An MDP with goal states, such as `NavigationProblem`."""

    @property
    def mdp(self) -> Mdp:
        """The MDP."""

    @property
    def goal_states(self) -> IntArray:
        """Indices of the states that count as arrived."""


def goal_mask(problem: GoalProblem) -> BoolArray:
    """(S,) which states count as arrived: those of `goal_states`, numbers or an (S,) mask.

    SerdError where a goal is no state of the problem.
    """
    require_problem(problem, "goal_states", "NavigationProblem")
    n_states = problem.mdp.n_states
    mask = np.zeros(n_states, dtype=np.bool_)
    mask[chosen_indices("goal_states", problem.goal_states, n_states, "a state")] = True
    return mask


def policy_chain(
    mdp: Mdp, policy: FloatArray, outcome_probabilities: FloatArray | None
) -> scipy.sparse.csr_array:
    """(S, S) Markov chain of an (S, A) policy; None for transitions without parameters."""
    choice = checked_policy("policy", policy, mdp)
    transitions = transitions_of(mdp.transitions, outcome_probabilities)
    entries = transitions.entries * choice.ravel()[mdp.transitions.row]
    state = mdp.transitions.row // mdp.n_actions
    shape = (mdp.n_states, mdp.n_states)
    return scipy.sparse.csr_array((entries, (state, mdp.transitions.successor)), shape=shape)


@dataclass(frozen=True, eq=False)
class ArrivalByState:
    """cdf: (n_steps + 1, S) F_n(s); arrival_probability: (S,) of ever arriving.

    A step is a decision, or where decisions take time a step of time.
    """

    cdf: FloatArray
    arrival_probability: FloatArray

    @classmethod
    def average(cls, each: Iterable["ArrivalByState"]) -> "ArrivalByState":
        """Posterior prediction from that of each draw, of which one is held at a time."""
        cdf, probability, number = np.zeros(()), np.zeros(()), 0
        for one in each:
            cdf, probability = cdf + one.cdf, probability + one.arrival_probability
            number += 1
        return cls(cdf / number, probability / number)

    @property
    def n_steps(self) -> int:
        """The horizon."""
        return len(self.cdf) - 1

    @cached_property
    def mean_steps(self) -> FloatArray:
        """(S,) mean of min(steps until arrival, horizon): sum over n < horizon of 1 - F_n."""
        return np.asarray((1.0 - self.cdf[:-1]).sum(axis=0))

    def within(self, n_steps: int) -> FloatArray:
        """(S,) probability of arriving within so many steps; the horizon where it is beyond."""
        return np.asarray(self.cdf[min(max(n_steps, 0), self.n_steps)])
