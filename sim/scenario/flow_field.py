"""Which way people walk in each cell, derived from the loops and quantised to the four directions.

Each loop is a line that people walk within a lane. At a cell's centre the flow vector is

    f = sum over legs  share * max(0, 1 - (d / h)^2) * direction

with d the distance to the leg and h its reach: the lane's half width plus three quarters of a cell.
The cell's flow is the axis along which |f| is larger; no flow where f nearly vanishes.
"""

import numpy as np

from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import DIRECTION_VECTORS, Action
from sim.geometry.polygon import distance_to_segments_m, edges_of
from sim.scenario.settings import Loop

NO_FLOW = -1
_WEAKEST_FLOW = 0.05


def flow_vectors(loops: tuple[Loop, ...], points_m: FloatArray, cell_size_m: float) -> FloatArray:
    """(N, 2) sum of the walking directions around each point, weighted by share and nearness."""
    total = np.zeros((len(points_m), 2))
    for loop in loops:
        legs = edges_of(loop.waypoints_m)
        along = legs[:, 1] - legs[:, 0]
        direction = along / np.linalg.norm(along, axis=1, keepdims=True)
        reach = loop.lane_half_width_m + 0.75 * cell_size_m
        nearness = 1.0 - (distance_to_segments_m(points_m, legs) / reach) ** 2
        total += loop.share * np.maximum(nearness, 0.0) @ direction
    return total


def quantised_flow(vectors: FloatArray) -> IntArray:
    """(N,) the `Action` of the nearest direction, NO_FLOW where the vector nearly vanishes."""
    alignment = vectors @ DIRECTION_VECTORS[1:].T
    direction = np.argmax(alignment, axis=1) + int(Action.NORTH)
    strong = np.linalg.norm(vectors, axis=1) > _WEAKEST_FLOW
    return np.where(strong, direction, NO_FLOW).astype(np.int64)
