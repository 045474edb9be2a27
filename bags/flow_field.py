"""In which direction people walk in each cell, from recorded people.

The flow of a cell is the axis nearest to the sum of the velocities seen in it; there is none where
fewer than a number of people were seen, or where they do not walk in one direction: the order
|sum v| / sum |v| is 1 when all walk the same way and 0 when they cancel.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bags.errors import BagError
from bags.point_cloud import point_cloud
from bags.reader import BagReader, topic_named
from serd_core.arrays import FloatArray, IntArray
from serd_core.directions import action_of_direction
from serd_core.grid import Grid
from serd_core.navigation import NO_FLOW

PEDESTRIANS = "pedestrians"
_FIELDS = ("x", "y", "vx", "vy")


@dataclass(frozen=True)
class FlowRule:
    """minimum_count: sightings below which a cell has no flow; minimum_order: 0 to 1."""

    minimum_count: int = 20
    minimum_order: float = 0.5


@dataclass(frozen=True, eq=False)
class FlowField:
    """flow (S,) an `Action` or -1; mean_velocity_mps (S, 2); order (S,) 0 to 1; count (S,)."""

    flow: IntArray
    mean_velocity_mps: FloatArray
    order: FloatArray
    count: IntArray


class FlowEstimator:
    """Adds up velocities per cell, message by message."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._sum_mps = np.zeros((grid.n_states, 2))
        self._speed_mps = np.zeros(grid.n_states)
        self._count = np.zeros(grid.n_states, dtype=np.int64)

    def add(self, position_m: FloatArray, velocity_mps: FloatArray) -> None:
        """People at (N, 2) with velocities (N, 2); those off the grid or not finite are left."""
        state = self._grid.states_at(position_m)
        seen = (state >= 0) & np.isfinite(velocity_mps).all(axis=1)
        state, velocity = state[seen], velocity_mps[seen]
        np.add.at(self._sum_mps, state, velocity)
        np.add.at(self._speed_mps, state, np.hypot(velocity[:, 0], velocity[:, 1]))
        np.add.at(self._count, state, 1)

    def field(self, rule: FlowRule | None = None) -> FlowField:
        """The flow so far."""
        rule = rule or FlowRule()
        length = np.hypot(self._sum_mps[:, 0], self._sum_mps[:, 1])
        order = np.divide(length, self._speed_mps, out=np.zeros_like(length), where=length > 0)
        known = (self._count >= rule.minimum_count) & (order >= rule.minimum_order) & (length > 0)
        flow = np.full(self._grid.n_states, NO_FLOW, dtype=np.int64)
        for state in np.flatnonzero(known):
            flow[state] = action_of_direction(*(self._sum_mps[state] / length[state]))
        mean = self._sum_mps / np.maximum(self._count, 1)[:, None]
        return FlowField(flow, mean, order, self._count.copy())


def flow_from_bag(
    path: str | Path, grid: Grid, *, topic: str = PEDESTRIANS, rule: FlowRule | None = None
) -> FlowField:
    """The flow of the people on a PointCloud2 topic with the fields x, y, vx, vy."""
    reader = BagReader(path)
    estimator = FlowEstimator(grid)
    n_clouds = 0
    for message in reader.messages([topic_named(reader.topics, topic)]):
        fields = point_cloud(message.data, _FIELDS).fields
        estimator.add(
            np.stack([fields["x"], fields["y"]], axis=1),
            np.stack([fields["vx"], fields["vy"]], axis=1),
        )
        n_clouds += 1
    if not n_clouds:
        raise BagError(f"bag {path} must hold people on {topic}, got no message; record it too")
    return estimator.field(rule)
