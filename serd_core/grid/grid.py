"""The coarse grid on which the high-level strategy decides (section 5.1.1 of the thesis).

Rows count northwards (+y) and columns eastwards (+x). States are the walkable cells, numbered row
by row from row 0. A cell covers [low, high) in both coordinates.
"""

import hashlib
import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy  # loads ndimage at its first use
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.checks import bool_array, require_positive
from serd_core.errors import SerdError

AnyArray = TypeVar("AnyArray", FloatArray, IntArray)


class Action(IntEnum):
    """What the strategy may choose in a state."""

    WAIT = 0
    NORTH = 1
    EAST = 2
    SOUTH = 3
    WEST = 4


class Outcome(IntEnum):
    """What a decision led to, relative to the intended direction (Table 5.1)."""

    STAY = 0
    FORWARD = 1
    RIGHT = 2
    BACK = 3
    LEFT = 4


#: (5, 2) steps (east, north) in cells, in the order of `Action`.
DIRECTION_VECTORS: IntArray = np.array([[0, 0], [0, 1], [1, 0], [0, -1], [-1, 0]], dtype=np.int64)
DIRECTION_VECTORS.flags.writeable = False
#: Products of larger lengths, and of those below its inverse, overflow, also in single precision.
_LARGEST_M = 1e30


@dataclass(frozen=True, eq=False)
class Grid:
    """Walkable square cells of a map.

    origin_m: lower-left corner (x, y) of the cell at row 0, column 0.
    cell_size_m: side of a cell.
    walkable: (rows, columns) mask.
    """

    origin_m: tuple[float, float]
    cell_size_m: float
    walkable: BoolArray

    def __post_init__(self) -> None:
        origin = tuple(float(value) for value in self.origin_m)
        if len(origin) != 2 or not np.all(np.isfinite(origin)):
            raise SerdError(f"origin_m must be two finite numbers (x, y), got {self.origin_m}")
        require_positive("cell_size_m", self.cell_size_m)
        largest_m = max(self.cell_size_m, *map(abs, origin))
        if self.cell_size_m < 1.0 / _LARGEST_M or largest_m > _LARGEST_M:
            raise SerdError(
                f"cell_size_m must be from {1.0 / _LARGEST_M:g} to {_LARGEST_M:g} and origin_m at"
                f" most that, got {self.cell_size_m:g} and {origin}; use metres"
            )
        walkable = bool_array("walkable", self.walkable, (None, None))
        if not walkable.any():
            raise SerdError("walkable must have at least one true cell, got none; check the map")
        object.__setattr__(self, "origin_m", origin)
        object.__setattr__(self, "cell_size_m", float(self.cell_size_m))
        object.__setattr__(self, "walkable", walkable)

    @property
    def n_states(self) -> int:
        """Number of walkable cells."""
        return len(self.cells)

    @cached_property
    def cells(self) -> IntArray:
        """(S, 2) row and column of each state."""
        return _read_only(np.argwhere(self.walkable).astype(np.int64))

    @cached_property
    def state_of_cell(self) -> IntArray:
        """(rows, columns) state number of each cell, -1 where not walkable."""
        table = np.full(self.walkable.shape, -1, dtype=np.int64)
        table[self.walkable] = np.arange(self.n_states)
        return _read_only(table)

    @cached_property
    def centers_m(self) -> FloatArray:
        """(S, 2) centre (x, y) of each state in metres."""
        column_row = self.cells[:, ::-1]
        centers = np.asarray(self.origin_m) + (column_row + 0.5) * self.cell_size_m
        return _read_only(np.asarray(centers, dtype=np.float64))

    @cached_property
    def neighbours(self) -> IntArray:
        """(S, 5) state reached by each `Action`; the state itself for WAIT or where blocked."""
        own = np.arange(self.n_states)
        table = np.empty((self.n_states, len(DIRECTION_VECTORS)), dtype=np.int64)
        for action, (east, north) in enumerate(DIRECTION_VECTORS):
            found = self._states_of_cells(self.cells[:, 0] + north, self.cells[:, 1] + east)
            table[:, action] = np.where(found < 0, own, found)
        return _read_only(table)

    def states_at(self, points_m: ArrayLike) -> IntArray:
        """(N,) state under each of the (N, 2) points; -1 outside, in a wall, or not finite."""
        points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
        finite = np.asarray(np.isfinite(points).all(axis=1))
        scaled = (np.where(finite[:, None], points, 0.0) - self.origin_m) / self.cell_size_m
        largest = float(max(self.walkable.shape))
        cell = np.floor(np.clip(scaled, -1.0, largest)).astype(np.int64)
        return np.where(finite, self._states_of_cells(cell[:, 1], cell[:, 0]), -1)

    def state_at(self, x_m: float, y_m: float) -> int:
        """State under one point, -1 outside or not walkable."""
        return int(self.states_at([[x_m, y_m]])[0])

    def fingerprint(self) -> str:
        """Hexadecimal SHA-256 of the geometry: equal exactly for equal grids."""
        rows, columns = self.walkable.shape
        header = f"{self.origin_m[0]!r},{self.origin_m[1]!r},{self.cell_size_m!r},{rows},{columns}"
        return hashlib.sha256(header.encode() + np.packbits(self.walkable).tobytes()).hexdigest()

    def _states_of_cells(self, row: IntArray, column: IntArray) -> IntArray:
        rows, columns = self.walkable.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        table = self.state_of_cell[np.where(inside, row, 0), np.where(inside, column, 0)]
        return np.where(inside, table, -1)


def _read_only(array: AnyArray) -> AnyArray:
    array.flags.writeable = False
    return array


def direction_of_action(action: Action) -> tuple[float, float]:
    """(east, north) unit vector of an action, (0, 0) to wait."""
    east, north = DIRECTION_VECTORS[action]
    return float(east), float(north)


def action_of_direction(east: float, north: float) -> Action:
    """The action a direction vector means: the nearest axis, WAIT for a vector shorter than 1/2."""
    if not (math.isfinite(east) and math.isfinite(north)):
        raise SerdError(f"a direction must be finite, got ({east}, {north}); send (0, 0) to wait")
    if math.hypot(east, north) < 0.5:
        return Action.WAIT
    if abs(east) >= abs(north):
        return Action.EAST if east > 0 else Action.WEST
    return Action.NORTH if north > 0 else Action.SOUTH


def grid_wall_distance_m(grid: Grid) -> FloatArray:
    """(S,) metres from each cell's centre to the nearest blocked cell; outside is blocked."""
    distance = np.full(grid.n_states, np.inf)
    free = np.pad(grid.walkable, 2)
    near = scipy.ndimage.binary_dilation(free, np.ones((3, 3)))  # corners included
    for blocked in np.argwhere(near & ~free) - 2.0:
        gap = np.maximum(np.abs(grid.cells - blocked) - 0.5, 0.0)
        distance = np.minimum(distance, np.hypot(gap[:, 0], gap[:, 1]))
    return np.asarray(distance * grid.cell_size_m)
