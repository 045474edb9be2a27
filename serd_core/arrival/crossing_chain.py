"""The cells that a policy crosses, as the states of a semi-Markov chain.

Of the moves of a decision period those that stay are left out: given that a cell is left,

    P(s' | s) = sum_a pi(a|s) P(s'|s,a) / sum_a pi(a|s) (1 - P(s|s,a)),    s' != s

and the time until then is a dwell time of its class (`serd_core.arrival.semi_markov`), however many
periods it takes. A robot that turns takes longer, so the states of the chain are pairs of a cell
and the direction in which it was entered, index 4 s + direction - 1. The class of a move is
2 m + 1[it turns], m the outcome model of an action in its direction: with, against, across flow.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.chain import ArrivalByState, goal_mask, policy_chain
from serd_core.arrival.semi_markov import RenewalChain
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import WAITING, NavigationProblem, model_of_action

#: Directions in which a cell is entered, and classes of moves.
N_DIRECTIONS = 4
N_CLASSES = 2 * WAITING


class Kind(Enum):
    """How a cell was left: as it was entered, in another direction, or as the first one."""

    STRAIGHT = "straight"
    TURNING = "turning"
    FIRST = "first"


@dataclass(frozen=True, eq=False)
class CrossingMoves:
    """E moves out of cells: state, successor, direction (E,); probability (E,) given the cell.

    model: (E,) place in `MODEL_NAMES`. goal: (S,) mask; cells of the goal and those that are never
    left have no moves.
    """

    state: IntArray
    successor: IntArray
    direction: IntArray
    probability: FloatArray
    model: IntArray
    goal: BoolArray


def direction_of_move(grid: Grid, state: IntArray, successor: IntArray) -> IntArray:
    """(E,) the `Action` that leads from each state to its neighbour; 0 where it is none."""
    towards = grid.neighbours[state][:, 1:] == successor[:, None]
    return np.where(
        towards.any(axis=1) & (state != successor), towards.argmax(axis=1) + 1, int(Action.WAIT)
    )


def crossing_moves(
    problem: NavigationProblem, policy: FloatArray, outcome_probabilities: FloatArray
) -> CrossingMoves:
    """The moves out of its cells that an (S, A) policy makes under outcome models."""
    goal = goal_mask(problem)
    chain = policy_chain(problem.mdp, policy, outcome_probabilities).tocoo()
    chain.sum_duplicates()
    leaving = (chain.row != chain.col) & ~goal[chain.row] & (chain.data > 0)
    state, successor = (each[leaving].astype(np.int64) for each in (chain.row, chain.col))
    total = np.bincount(state, chain.data[leaving], minlength=len(goal))
    direction = direction_of_move(problem.grid, state, successor)
    return CrossingMoves(
        state=state,
        successor=successor,
        direction=direction,
        probability=chain.data[leaving] / total[state],
        model=model_of_action(direction, problem.flow[state]),
        goal=goal,
    )


def crossing_chain(moves: CrossingMoves) -> RenewalChain:
    """The chain of (cell, direction of entry); a cell that is never left moves to itself."""
    entered = np.arange(1, N_DIRECTIONS + 1)
    never = np.setdiff1d(np.flatnonzero(~moves.goal), moves.state)
    turning = moves.direction[:, None] != entered
    state = N_DIRECTIONS * moves.state[:, None] + entered - 1
    successor = N_DIRECTIONS * moves.successor + moves.direction - 1
    own = (N_DIRECTIONS * never[:, None] + entered - 1).ravel()
    return RenewalChain(
        state=np.concatenate([state.ravel(), own]),
        successor=np.concatenate([np.repeat(successor, N_DIRECTIONS), own]),
        probability=np.concatenate([np.repeat(moves.probability, N_DIRECTIONS), np.ones(len(own))]),
        dwell=np.concatenate(
            [(2 * moves.model[:, None] + turning).ravel(), np.zeros(len(own), dtype=np.int64)]
        ),
        goal=np.repeat(moves.goal, N_DIRECTIONS),
    )


def cdf_after_first_moves(
    moves: CrossingMoves,
    share: FloatArray,
    first: FloatArray,
    first_class: IntArray,
    arrival: ArrivalByState,
) -> FloatArray:
    """(N + 1,) arrival of a robot that is in a cell whose entry was not seen.

    share: (S,) probability of each cell; first: (C, J) dwell times of the first move in steps;
    first_class: (E,) that of each move; arrival: from the states of `crossing_chain`.
    """
    n_steps = len(arrival.cdf)
    cdf = np.full(n_steps, share[moves.goal].sum())
    onward = N_DIRECTIONS * moves.successor + moves.direction - 1
    weight = share[moves.state] * moves.probability
    for number, mass in enumerate(first):
        mine = (first_class == number) & (weight > 0)
        if mine.any():
            later = arrival.cdf[:, onward[mine]] @ weight[mine]
            cdf += np.convolve(mass, later)[:n_steps]
    return np.asarray(np.clip(cdf, 0.0, 1.0))
