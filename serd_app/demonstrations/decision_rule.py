"""From where a decision period began and ended to the next state of the MDP.

The grid's dynamics know five outcomes: the own cell and its four neighbours. A robot that ended
elsewhere (diagonally, or more than one cell on) is assigned the neighbour in the direction in which
it moved farthest; where that is no cell, the one in the other direction.
"""

from enum import Enum

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.grid.grid import Action, Grid, action_of_direction


class Move(Enum):
    """What kind of move a decision period was."""

    ADJACENT = "own cell or a neighbour"
    DIAGONAL = "diagonal"
    FAR = "more than one cell"


def next_state_of(grid: Grid, state: int, reached: int, end_m: FloatArray) -> tuple[int, Move]:
    """(next state, kind of move) from a cell to the cell that holds end_m (2,); -1 where no
    neighbour explains the move."""
    if reached == state or reached in grid.neighbours[state]:
        return reached, Move.ADJACENT
    steps = np.abs(grid.cells[reached] - grid.cells[state])
    move = Move.DIAGONAL if steps.max() == 1 else Move.FAR
    east, north = end_m - grid.centers_m[state]
    for direction in sorted([(east, 0.0), (0.0, north)], key=lambda d: -abs(d[0] + d[1])):
        action = action_of_direction(*np.sign(direction))
        neighbour = int(grid.neighbours[state, action])
        if action != Action.WAIT and neighbour != state:
            return neighbour, move
    return -1, move
