"""Waypoints some cells ahead, so that the robot need not stop in every cell.

The cells are those the policy most probably takes the robot to: from each the likeliest successor
of its greedy action other than itself, for as long as that is straight on and short of the goal.
Round corners the robot is not sent ahead, where the way between the cells may be barred.
"""

import numpy as np

from serd_app.navigation.strategy import Strategy
from serd_core.arrays import IntArray
from serd_core.arrival.chain import policy_chain
from serd_core.grid.grid import Action


def likeliest_next(strategy: Strategy) -> IntArray:
    """(S,) cell the greedy action most probably moves to; the same where it moves nowhere."""
    mdp = strategy.problem.mdp
    greedy = np.eye(mdp.n_actions)[strategy.policy.greedy]
    chain = policy_chain(mdp, greedy, strategy.outcome_probabilities)
    chain.setdiag(0.0)
    moves = np.asarray(chain.max(axis=1).todense()).ravel() > 0
    return np.where(moves, np.asarray(chain.argmax(axis=1)).ravel(), np.arange(mdp.n_states))


def cell_ahead(
    strategy: Strategy, next_of: IntArray, state: int, action: Action, n_cells: int
) -> int:
    """The cell to send a robot in `state` to: `n_cells` straight on by `action`, or fewer."""
    neighbours, goals = strategy.problem.grid.neighbours, strategy.problem.goal_states
    ahead = int(neighbours[state, action])
    for _ in range(n_cells - 1):
        straight_on = int(neighbours[ahead, action])
        if ahead in goals or straight_on == ahead or next_of[ahead] != straight_on:
            break
        ahead = straight_on
    return ahead
