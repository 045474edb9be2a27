"""Trap states: where a policy does not lead to the goal (Fig. 5.11 of the thesis).

There are two kinds of trap states:

- *looping*: each action is followed as if it always had its intended outcome; the chain of cells of
  greedy actions either reaches a goal or runs into a cycle, and actions that are drawn reach a goal
  by some chain or by none. Outcomes of low probability may free a robot from such a cycle by
  chance, which is why the transition probabilities are left out here.
- *unlikely*: under the learned dynamics, chance included, the policy arrives within the horizon
  with less than a threshold probability.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.absorption import can_reach


@dataclass(frozen=True, eq=False)
class Traps:
    """looping, unlikely: (S,) masks; threshold: probability below which states are `unlikely`."""

    looping: BoolArray
    unlikely: BoolArray
    threshold: float

    @property
    def states(self) -> IntArray:
        """Indices of the states that are trapped in either way."""
        return np.flatnonzero(self.looping | self.unlikely)

    def __contains__(self, state: int) -> bool:
        return bool(self.looping[state] or self.unlikely[state])


def find_traps(
    neighbours: IntArray,
    policy: IntArray | FloatArray,
    goal_states: IntArray,
    arrival_probability: FloatArray,
    threshold: float,
) -> Traps:
    """Both kinds of trap states. policy: see `trap_states`; arrival_probability: (S,) within the
    horizon that matters."""
    return Traps(
        looping=trap_states(neighbours, policy, goal_states),
        unlikely=np.asarray(arrival_probability < threshold),
        threshold=threshold,
    )


def trap_states(
    neighbours: IntArray, policy: IntArray | FloatArray, goal_states: IntArray
) -> BoolArray:
    """(S,) mask of the looping states.

    neighbours: (S, A) next cell of each intended move; policy: (S,) the action of each state, or
    (S, A) probabilities of actions; goal_states: (G,).

    >>> trap_states(np.array([[0, 1], [0, 2], [1, 2]]), np.array([1, 1, 1]), np.array([2]))
    array([False, False, False])
    """
    n_states, n_actions = neighbours.shape
    taken = policy > 0 if policy.ndim == 2 else policy[:, None] == np.arange(n_actions)
    state, action = np.nonzero(taken)
    steps = np.ones(len(state)), (state, neighbours[state, action])
    goal = np.isin(np.arange(n_states), goal_states)
    return ~can_reach(scipy.sparse.csr_array(steps, shape=(n_states, n_states)), goal)
