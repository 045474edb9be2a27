"""States from which the greedy policy never arrives (Fig. 5.11 of the thesis).

Each greedy action is followed as if it always had its intended outcome; the chain of cells either
reaches a goal state or runs into a cycle. Outcomes of low probability may free a robot from such a
cycle by chance, which is why the transition probabilities are left out here.
"""

import numpy as np

from serd_core.arrays import BoolArray, IntArray


def trap_states(neighbours: IntArray, greedy: IntArray, goal_states: IntArray) -> BoolArray:
    """(S,) mask of the trap states.

    neighbours: (S, A) next cell of each intended move; greedy: (S,); goal_states: (G,).
    """
    n_states = len(greedy)
    successor = neighbours[np.arange(n_states), greedy].copy()
    successor[goal_states] = goal_states
    for _ in range(int(n_states).bit_length()):
        successor = successor[successor]
    return ~np.isin(successor, goal_states)
