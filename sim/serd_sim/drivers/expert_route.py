"""How a person would like to go: cheapest ways to the goal over (cell, last direction).

Cost of a move = 1 + against the flow + across it + lane dislike + turning; Dijkstra from the goal.
These costs are the expert's own and are not the features that are later estimated.
"""

import heapq
from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action, Grid

MOVES = (Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST)


@dataclass(frozen=True)
class RouteCosts:
    """Costs in units of one move."""

    against_flow: float = 4.0
    across_flow: float = 0.5
    turning: float = 0.4
    lane_dislike: float = 0.35


def move_costs(
    grid: Grid, flow: IntArray, costs: RouteCosts, rng: np.random.Generator
) -> FloatArray:
    """(S, 5) cost of each move this time, inf where blocked or WAIT.

    The dislike of lanes is drawn once for every row and column of cells, so that people choose a
    lane and keep to it.
    """
    vectors = DIRECTION_VECTORS.astype(np.float64)
    flow_vector = np.where(flow[:, None] >= 0, vectors[np.maximum(flow, 0)], 0.0)
    along = flow_vector @ vectors.T
    has_flow = (flow >= 0)[:, None]
    cost = 1.0 + costs.against_flow * (along < 0) + costs.across_flow * (has_flow & (along == 0))
    dislike = costs.lane_dislike * rng.exponential(size=sum(grid.walkable.shape))
    row_dislike, column_dislike = np.split(dislike, [grid.walkable.shape[0]])
    cost = cost + np.where(
        vectors[None, :, 0] != 0,
        row_dislike[grid.cells[:, 0], None],
        column_dislike[grid.cells[:, 1], None],
    )
    blocked = grid.neighbours == np.arange(grid.n_states)[:, None]
    return np.where(blocked, np.inf, cost)


def opposite_flow(flow: IntArray) -> IntArray:
    """(S,) the flow turned round; cells without flow stay without."""
    return np.where(flow > 0, (flow + 1) % 4 + 1, flow)


def costs_to_go(
    grid: Grid, cost: FloatArray, goal_states: IntArray, turning_cost: float
) -> FloatArray:
    """(S, 5) cheapest cost to the goal from each state, having moved by each action last.

    Column WAIT: no direction yet, so that the first move turns for nothing.
    """
    to_go = np.full((grid.n_states, len(Action)), np.inf)
    to_go[goal_states] = 0.0
    queue = [(0.0, int(state), int(action)) for state in goal_states for action in MOVES]
    heapq.heapify(queue)
    came_from = _predecessors(grid)
    while queue:
        value, state, arrived_by = heapq.heappop(queue)
        if value > to_go[state, arrived_by]:
            continue
        for before in came_from[state][arrived_by]:
            step = value + cost[before, arrived_by]
            for last in Action:
                turned = last not in (Action.WAIT, arrived_by)
                total = step + turning_cost * turned
                if total < to_go[before, last]:
                    to_go[before, last] = total
                    heapq.heappush(queue, (float(total), before, int(last)))
    return to_go


def _predecessors(grid: Grid) -> list[list[list[int]]]:
    """[state][action]: the states from which that action leads to the state."""
    table: list[list[list[int]]] = [[[] for _ in Action] for _ in range(grid.n_states)]
    for state in range(grid.n_states):
        for action in MOVES:
            reached = int(grid.neighbours[state, action])
            if reached != state:
                table[reached][action].append(state)
    return table
