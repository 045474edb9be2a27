"""A trajectory as the sequence of cells that it crosses, with the time of each crossing.

A position belongs to its cell until it is `hysteresis_m` beyond the border, so a person who sways
on a border does not cross it again and again. Between two positions the way is a straight line, and
of two borders that it passes the first one counts: so each move leads to one of the four
neighbours, and none is diagonal or far, whatever the period of the positions is.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray, IntArray, first_index, float_array
from serd_core.errors import SerdError
from serd_core.grid.grid import Grid


@dataclass(frozen=True, eq=False)
class Crossings:
    """Cells in their order, with times.

    state: (N,); entered_s: (N,) when each was entered, for the first one that of the first position
    on the grid; left_s: when the last one was left, NaN where the trajectory ends in it.
    """

    state: IntArray
    entered_s: FloatArray
    left_s: float

    def __len__(self) -> int:
        return len(self.state)


def cell_crossings(
    grid: Grid, time_s: FloatArray, position_m: FloatArray, hysteresis_m: float = 0.0
) -> Crossings:
    """The cells of (T, 2) positions at increasing times (T,).

    The way ends where it leaves the grid at its first or last column. All other borders without a
    cell behind them are walls: beyond, a position counts as in the cell before, since measured
    places pass walls by a few centimetres.
    """
    times = float_array("time_s", time_s, (None,))
    places = float_array("position_m", position_m, (len(times), 2))
    if (late := first_index(np.diff(times) <= 0)) is not None:
        raise SerdError(
            f"time_s must increase, got {times[late[0] + 1]} after {times[late[0]]}; sort the rows"
        )
    if not 0 <= hysteresis_m < grid.cell_size_m / 2:
        raise SerdError(
            f"hysteresis_m must be at least 0 and below half a cell ({grid.cell_size_m / 2} m), got"
            f" {hysteresis_m}"
        )
    return _Walk(grid, hysteresis_m / grid.cell_size_m).follow(times, places)


@dataclass(frozen=True, eq=False)
class _Walk:
    """margin: hysteresis in cells."""

    grid: Grid
    margin: float

    def follow(self, times: FloatArray, places: FloatArray) -> Crossings:
        scaled = (places - self.grid.origin_m) / self.grid.cell_size_m
        inside = np.flatnonzero(self.grid.states_at(places) >= 0)
        if not len(inside):
            return Crossings(np.zeros(0, dtype=np.int64), np.zeros(0), np.nan)
        first = int(inside[0])
        cell = np.floor(scaled[first]).astype(np.int64)
        cells, entered = [self._state(cell)], [float(times[first])]
        row = first
        while (row := self._next_outside(scaled, row + 1, cell)) < len(times):
            begin_s, step_s = times[row - 1], times[row] - times[row - 1]
            while (move := self._first_border(scaled[row - 1], scaled[row], cell)) is not None:
                axis, side, share = move
                cell = cell.copy()
                cell[axis] += side
                state, at_s = self._state(cell), float(begin_s + share * step_s)
                if state < 0:
                    return Crossings(np.array(cells), np.array(entered), at_s)
                cells.append(state)
                entered.append(max(at_s, entered[-1]))
        return Crossings(np.array(cells), np.array(entered), np.nan)

    def _next_outside(self, scaled: FloatArray, row: int, cell: IntArray) -> int:
        """First row from one on that is beyond the margin of a cell; their number where none is."""
        away = np.abs(scaled[row:] - cell - 0.5).max(axis=1, initial=0.0)
        outside = np.flatnonzero(away > 0.5 + self.margin)
        return row + int(outside[0]) if len(outside) else len(scaled)

    def _first_border(
        self, before: FloatArray, after: FloatArray, cell: IntArray
    ) -> tuple[int, int, float] | None:
        """(axis, side, share of the step) of the border that is passed first; None where none."""
        passed = []
        for axis in (0, 1):
            for side in (-1, 1):
                border = cell[axis] + (side > 0) + side * self.margin
                if side * (after[axis] - border) <= 0 or self._is_wall(cell, axis, side):
                    continue
                moved = after[axis] - before[axis]
                share = (border - before[axis]) / moved if moved * side > 0 else 0.0
                passed.append((min(max(share, 0.0), 1.0), axis, side))
        if not passed:
            return None
        share, axis, side = min(passed)
        return axis, side, share

    def _is_wall(self, cell: IntArray, axis: int, side: int) -> bool:
        there = cell.copy()
        there[axis] += side
        inside = 0 <= there[0] < self.grid.walkable.shape[1]
        return bool(inside) and self._state(there) < 0

    def _state(self, cell: IntArray) -> int:
        column, row = int(cell[0]), int(cell[1])
        rows, columns = self.grid.walkable.shape
        if not (0 <= row < rows and 0 <= column < columns):
            return -1
        return int(self.grid.state_of_cell[row, column])
