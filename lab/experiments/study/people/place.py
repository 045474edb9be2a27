"""The corridors of all runs as one navigation problem (section 5.1), and parts that they share.

States are the cells of the runs, one run after the other, with a wall between two of them; the last
columns are goals. All who walk are turned to walk east, so one problem holds for both directions.
People flow west in a cell where more of those are seen who walk the opposite way, and else east.

What is counted in one corridor holds for the same part of others, whatever their sizes are.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lab.experiments.study.people.recordings import Run
from serd_core.arrays import BoolArray, FloatArray, IntArray, weighted_counts
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NavigationProblem, build_navigation_problem, with_dwell_times

#: Parts of a corridor of any size, along and across.
PARTS = (6, 5)


@dataclass(frozen=True, eq=False)
class Place:
    """The corridors; discount: per second; patience_s, wait_s: see `with_dwell_times`."""

    runs: tuple[Run, ...]
    discount: float
    patience_s: float
    wait_s: float

    @cached_property
    def start(self) -> IntArray:
        """(R + 1,) first state of each run."""
        return np.concatenate([[0], np.cumsum([run.grid.n_states for run in self.runs])])

    @cached_property
    def grid(self) -> Grid:
        """One above the other."""
        shapes = np.array([run.grid.walkable.shape for run in self.runs])
        low = np.concatenate([[0], np.cumsum(shapes[:, 0] + 1)])
        walkable = np.zeros((low[-1] - 1, shapes[:, 1].max()), dtype=np.bool_)
        for first, (rows, columns) in zip(low[:-1], shapes, strict=True):
            walkable[first : first + rows, :columns] = True
        return Grid((0.0, 0.0), self.runs[0].grid.cell_size_m, walkable)

    @cached_property
    def goal_states(self) -> IntArray:
        """The last columns."""
        ends = [run.column == run.n_columns - 1 for run in self.runs]
        return np.flatnonzero(np.concatenate(ends))

    @cached_property
    def part(self) -> IntArray:
        """(S,) the part in which each cell is."""
        return np.concatenate([_part(run) for run in self.runs])

    def by_part(self, by_cell: FloatArray) -> FloatArray:
        """(B, ...) sums of (S, ...) over the cells of each part.

        A part in which a corridor has no centre takes the cell in its middle, so what is counted in
        a narrow corridor covers all parts of a wide one.
        """
        inside = np.concatenate([_cells_of_parts(run) for run in self.runs], axis=1)
        return np.asarray(inside @ by_cell)

    def flow(self, decisions: TimedDecisions, sign: IntArray) -> IntArray:
        """(S,) the flow of those who decided; sign: (N,) of the walker of each decision."""
        ahead_s = np.zeros(self.grid.n_states)
        for first, end in zip(self.start[:-1], self.start[1:], strict=True):
            here = (decisions.state >= first) & (decisions.state < end)
            there_s = [
                weighted_counts(
                    decisions.state[here & (sign == side)] - first,
                    decisions.dwell_s[here & (sign == side)],
                    end - first,
                )
                for side in (-1, 1)
            ]
            for own_s, opposite_s in (there_s, there_s[::-1]):
                if own_s.any():
                    # Half a turn reverses the order of the cells.
                    ahead_s[first:end] += own_s - opposite_s[::-1]
        west = self.by_part(ahead_s)[self.part] < 0
        return np.where(west, int(Action.WEST), int(Action.EAST))

    def problem(self, flow: IntArray) -> NavigationProblem:
        """The problem among a flow (S,), with decisions that take time."""
        found = build_navigation_problem(
            grid=self.grid,
            flow=flow,
            goal_states=self.goal_states,
            wall_distance_m=np.concatenate([_wall_distance_m(run) for run in self.runs]),
            discount=self.discount,
        )
        return with_dwell_times(found, patience_s=self.patience_s, wait_s=self.wait_s)


def _wall_distance_m(run: Run) -> FloatArray:
    """(C,) of the centre of each cell."""
    half_m = run.grid.walkable.shape[0] * run.grid.cell_size_m / 2
    return np.asarray(half_m - np.abs(run.grid.centers_m[:, 1]))


def _part(run: Run) -> IntArray:
    """(C,)"""
    share = (run.grid.cells + 0.5) / run.grid.walkable.shape
    along = (share[:, 1] * PARTS[0]).astype(np.int64)
    return np.asarray(along * PARTS[1] + (share[:, 0] * PARTS[1]).astype(np.int64))


def _cells_of_parts(run: Run) -> BoolArray:
    """(B, C) mask."""
    part = np.arange(PARTS[0] * PARTS[1])
    found = part[:, None] == _part(run)
    middle = np.stack([(part % PARTS[1] + 0.5) / PARTS[1], (part // PARTS[1] + 0.5) / PARTS[0]])
    nearest = (middle.T * run.grid.walkable.shape).astype(np.int64)
    empty = ~found.any(axis=1)
    found[empty] = np.all(run.grid.cells == nearest[empty, None], axis=2)
    return np.asarray(found)
