"""The gridworld of section 4.6.2 as a learning problem, with its ground truth.

Five actions: stay, or move to one of four neighbours; outcomes are stay and the four directions.
Nine local models: staying, and each direction on open terrain and in forest, learned apart although
the truth is the same turned round. Features: brightness of the cell, and goal.
"""

from dataclasses import dataclass

import numpy as np

from lab.experiments.gridworld.landscape import Landscape
from serd_core.arrays import BoolArray, FloatArray
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.grid.grid import Action, Grid
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem

STAYING_MODEL, N_MODELS, N_OUTCOMES = 0, 9, 5
#: Probability of moving as intended, and of each way that it may go wrong.
OPEN_SUCCESS, OPEN_SIDEWAYS = 0.8, 0.1
FOREST_SUCCESS, FOREST_OTHER = 0.3, 0.175


@dataclass(frozen=True, eq=False)
class Gridworld:
    """A problem with its start distribution (S,) and forest mask (S,); the goal is one state."""

    problem: TabularProblem
    starts: FloatArray
    forest: BoolArray
    goal: int


def gridworld(landscape: Landscape, discount: float, *, goal_at_left: bool) -> Gridworld:
    """Goal near the northern edge, starts along the southern one; left or right for variety."""
    rows, columns = landscape.brightness.shape
    grid = Grid(origin_m=(0.0, 0.0), cell_size_m=1.0, walkable=np.ones((rows, columns), np.bool_))
    goal_column = columns // 4 if goal_at_left else (3 * columns) // 4
    goal = int(grid.state_of_cell[rows - 1 - rows // 10, goal_column])
    starts = np.zeros(grid.n_states)
    southern = grid.state_of_cell[0, columns // 2 :] if goal_at_left else grid.state_of_cell[0]
    starts[southern] = 1.0 / len(southern)
    of_state = np.zeros((grid.n_states, 1, 2))
    of_state[:, 0, 0] = landscape.brightness.ravel()
    of_state[goal, 0, 1] = 1.0
    features = np.broadcast_to(of_state, (grid.n_states, len(Action), 2))
    models = _outcome_models(grid, landscape)
    problem = TabularProblem(Mdp(models, discount), features, ("brightness", "goal"))
    return Gridworld(problem, starts, landscape.forest.ravel(), goal)


def true_dynamics() -> FloatArray:
    """(9, 5) ground-truth outcome probabilities."""
    table = np.zeros((N_MODELS, N_OUTCOMES))
    table[STAYING_MODEL, Action.WAIT] = 1.0
    for action in range(1, len(Action)):
        right, left = action % 4 + 1, (action + 2) % 4 + 1
        table[action, [action, right, left]] = OPEN_SUCCESS, OPEN_SIDEWAYS, OPEN_SIDEWAYS
        table[action + 4] = FOREST_OTHER
        table[action + 4, action] = FOREST_SUCCESS
    return table


def _outcome_models(grid: Grid, landscape: Landscape) -> OutcomeModels:
    actions = np.arange(len(Action))
    forest = landscape.forest.ravel()[:, None] & (actions != Action.WAIT)
    return OutcomeModels(
        successors=np.broadcast_to(grid.neighbours[:, None, :], (*forest.shape, N_OUTCOMES)),
        model_of=actions[None, :] + 4 * forest,
        available=np.broadcast_to(np.True_, forest.shape),
        n_models=N_MODELS,
    )
