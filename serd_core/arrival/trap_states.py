"""Trap states: where a policy does not lead to the goal (Fig. 5.11 of the thesis).

There are two kinds of trap states:

- *looping*: each greedy action is followed as if it always had its intended outcome; the chain of
  cells either reaches a goal or runs into a cycle. Outcomes of low probability may free a robot
  from such a cycle by chance, which is why the transition probabilities are left out here.
- *unlikely*: under the learned dynamics, chance included, the policy arrives within the horizon
  with less than a threshold probability.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray, float_array
from serd_core.errors import SerdError


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
    greedy: IntArray,
    goal_states: IntArray,
    arrival_probability: FloatArray,
    threshold: float,
) -> Traps:
    """Both kinds of trap states. arrival_probability: (S,) within the horizon that matters."""
    if not 0.0 <= threshold <= 1.0:
        raise SerdError(f"threshold must be a probability, got {threshold}; use for example 0.5")
    likely = float_array("arrival_probability", arrival_probability, (len(greedy),))
    return Traps(
        looping=trap_states(neighbours, greedy, goal_states),
        unlikely=np.asarray(likely < threshold),
        threshold=threshold,
    )


def trap_states(neighbours: IntArray, greedy: IntArray, goal_states: IntArray) -> BoolArray:
    """(S,) mask of the looping states.

    neighbours: (S, A) next cell of each intended move; greedy: (S,); goal_states: (G,).
    """
    n_states = len(greedy)
    successor = neighbours[np.arange(n_states), greedy].copy()
    successor[goal_states] = goal_states
    for _ in range(int(n_states).bit_length()):
        successor = successor[successor]
    return ~np.isin(successor, goal_states)
