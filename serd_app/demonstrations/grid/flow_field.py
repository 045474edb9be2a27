"""In which direction people walk in each cell, from recorded people.

The flow of a cell is the axis nearest to the sum of the velocities seen in it; there is none where
fewer than a number of people were seen, or where they do not walk in one direction: the order
|sum v| / sum |v| is 1 when all walk the same way and 0 when they cancel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b

import numpy as np

from serd_app.drives.recorded_people import Sighting
from serd_app.drives.recording import Recording
from serd_app.drives.table_drives import Crowd
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import Grid, action_of_direction
from serd_core.grid.navigation import NO_FLOW

PEDESTRIANS = "pedestrians"


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


def flow_from_recordings(
    recordings: Sequence[Recording], sightings: Sequence[Sequence[Sighting]], grid: Grid
) -> FlowField | None:
    """The flow of the people seen in all bags, and of the agents of all tables; None where there
    are none.

    A cloud or table that several of them hold counts once. sightings: of each recording.
    """
    estimator = FlowEstimator(grid)
    seen: set[bytes] = set()
    for each, people in zip(recordings, sightings, strict=True):
        if each.crowd is not None:
            if each.crowd.people:
                _add_crowd(estimator, each.crowd, seen)
            continue
        for one in people:
            if one.digest not in seen:
                seen.add(one.digest)
                estimator.add(one.people.position_m[:, :2], one.people.velocity_mps[:, :2])
    return estimator.field() if seen else None


def _add_crowd(estimator: FlowEstimator, crowd: Crowd, seen: set[bytes]) -> None:
    digest = blake2b(crowd.position_m.tobytes(), digest_size=16).digest()
    if digest not in seen:
        seen.add(digest)
        estimator.add(crowd.position_m, crowd.velocity_mps)
