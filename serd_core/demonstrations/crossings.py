"""A trajectory as the sequence of cells that it crosses, with the time of each crossing.

A position belongs to its cell until it is `hysteresis_m` beyond the border, so one who sways on a
border does not cross it again and again. Between two positions the way is a straight line, and of
two borders that it passes the first one counts: so each move leads to one of the four neighbours,
and none is diagonal or far, whatever the period of the positions is, unless walls are in the way.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from serd_core.errors import SerdError
from serd_core.grid.grid import Grid


class Entered(NamedTuple):
    """A cell, and when it was entered."""

    time_s: float
    state: int


class CellTracker:
    """The cell of one who is seen from time to time.

    All borders without a cell behind them are walls: beyond one, a position counts as in the cell
    before, since measured places pass walls by a few centimetres. One in a cell to which no way
    leads, as behind a pillar that half fills its cell, is entered from nowhere. state: -1 before
    the first position on the grid.
    """

    def __init__(self, grid: Grid, hysteresis_m: float = 0.0) -> None:
        if not 0 <= hysteresis_m < grid.cell_size_m / 2:
            raise SerdError(
                f"hysteresis_m must be at least 0 and below half a cell ({grid.cell_size_m / 2} m),"
                f" got {hysteresis_m}"
            )
        self._grid, self._margin = grid, hysteresis_m / grid.cell_size_m
        self.reset()

    def reset(self) -> None:
        """Forget the way: the next position is of somebody else, or after a gap."""
        self.state = -1
        self._last_s, self._last = 0.0, (0.0, 0.0)

    def see(
        self, time_s: float, x_m: float, y_m: float, *, is_last: bool = False
    ) -> Sequence[Entered]:
        """Take the next position, later than the last one; the cells entered since, in order.

        A position that is not finite is none. is_last: the way ends in the cell of the position,
        so that borders count without hysteresis.
        """
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return ()
        (left_m, low_m), size_m = self._grid.origin_m, self._grid.cell_size_m
        place = (x_m - left_m) / size_m, (y_m - low_m) / size_m
        before_s, before = self._last_s, self._last
        self._last_s, self._last = time_s, place
        if self.state < 0:
            self.state = self._grid.state_at(x_m, y_m)
            return () if self.state < 0 else (Entered(time_s, self.state),)
        row, column = self._grid.cells[self.state].tolist()
        margin = 0.0 if is_last else self._margin
        if self._is_in((column, row), place, margin):
            return ()
        entered, latest_s = list[Entered](), before_s
        while (move := self._first_border(before, place, (column, row), margin)) is not None:
            share, axis, side = move
            column, row = (column + side, row) if axis == 0 else (column, row + side)
            self.state = self._state(column, row)
            latest_s = max(latest_s, before_s + share * (time_s - before_s))
            entered.append(Entered(latest_s, self.state))
        there = self._grid.state_at(x_m, y_m)
        if there >= 0 and not self._is_in((column, row), place, margin):
            self.state = there
            entered.append(Entered(time_s, there))
        return entered

    @staticmethod
    def _is_in(cell: tuple[int, int], place: tuple[float, float], margin: float) -> bool:
        """Whether no border is passed, walls or not."""
        return all(
            low - margin <= at <= low + 1 + margin for low, at in zip(cell, place, strict=True)
        )

    def _first_border(
        self,
        before: tuple[float, float],
        after: tuple[float, float],
        cell: tuple[int, int],
        margin: float,
    ) -> tuple[float, int, int] | None:
        """(share of the step, axis, side) of the border that is passed first; None where none."""
        passed = []
        for axis in (0, 1):
            for side in (-1, 1):
                border = cell[axis] + (side > 0) + side * margin
                beyond = cell[0] + side * (axis == 0), cell[1] + side * (axis == 1)
                if side * (after[axis] - border) <= 0 or self._state(*beyond) < 0:
                    continue
                moved = after[axis] - before[axis]
                share = (border - before[axis]) / moved if moved * side > 0 else 0.0
                passed.append((min(max(share, 0.0), 1.0), axis, side))
        return min(passed) if passed else None

    def _state(self, column: int, row: int) -> int:
        rows, columns = self._grid.walkable.shape
        if not (0 <= row < rows and 0 <= column < columns):
            return -1
        return int(self._grid.state_of_cell[row, column])
