"""A grid as a YAML file, and pictures of it in characters, north up, that people read and edit."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from serd_bag.errors import FileError
from serd_core.arrays import BoolArray, IntArray
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model

WALKABLE, BLOCKED = ".", "#"
#: Of no flow, north, east, south and west.
_FLOW_SIGNS = ".^>v<"


def walkable_picture(grid: Grid) -> tuple[str, ...]:
    """Rows of `.` where a cell is walkable and `#` where it is blocked."""
    return _rows(np.where(grid.walkable, WALKABLE, BLOCKED))


def walkable_of_picture(rows: Sequence[str]) -> BoolArray:
    """(H, W) the walkable cells, the southernmost row first; rows must have the same length."""
    return np.asarray(_signs(rows) == WALKABLE)


def flow_picture(grid: Grid, flow: IntArray) -> tuple[str, ...]:
    """Rows of `^ > v <`, `.` where there is no flow, `#` where a cell is blocked."""
    signs = np.full(grid.walkable.shape, BLOCKED)
    signs[grid.walkable] = [_FLOW_SIGNS[max(each, Action.WAIT)] for each in flow.tolist()]
    return _rows(signs)


def flow_of_picture(rows: Sequence[str], grid: Grid) -> IntArray | None:
    """(S,) the flow of such rows; None where they are not a picture of this grid."""
    height, width = grid.walkable.shape
    if len(rows) != height or any(len(row) != width for row in rows):
        return None
    signs = _signs(rows)
    if not np.array_equal(signs != BLOCKED, grid.walkable):
        return None
    found = np.array([_FLOW_SIGNS.find(sign) for sign in signs[grid.walkable].tolist()])
    return None if (found < 0).any() else np.where(found == Action.WAIT, NO_FLOW, found)


def _rows(signs: NDArray[np.str_]) -> tuple[str, ...]:
    return tuple("".join(row) for row in signs[::-1])


def _signs(rows: Sequence[str]) -> NDArray[np.str_]:
    return np.array([list(row) for row in rows[::-1]])


class GridFile(StrictModel):
    """origin_m: lower-left corner of the lower-left cell. cells: the northernmost row first."""

    format: Literal["serd-grid"] = "serd-grid"
    format_version: Literal[1] = 1
    scenario: str = ""
    fingerprint: str
    origin_m: tuple[float, float]
    cell_size_m: float = Field(gt=0)
    cells: tuple[str, ...] = Field(min_length=1)

    @field_validator("cells")
    @classmethod
    def _rectangle(cls, cells: tuple[str, ...]) -> tuple[str, ...]:
        for number, row in enumerate(cells):
            if len(row) != len(cells[0]) or not row or set(row) - {WALKABLE, BLOCKED}:
                raise ValueError(
                    f"[{number}] must be {len(cells[0])} of {WALKABLE!r} (walkable) and"
                    f" {BLOCKED!r} (blocked), got {row!r}"
                )
        return cells


def save_grid(path: str | Path, grid: Grid, scenario: str = "") -> None:
    """Write the grid; `scenario` is the name of the scenario it belongs to."""
    model = GridFile(
        scenario=scenario,
        fingerprint=grid.fingerprint(),
        origin_m=grid.origin_m,
        cell_size_m=grid.cell_size_m,
        cells=walkable_picture(grid),
    )
    save_yaml_model(path, model)


def load_grid(path: str | Path) -> Grid:
    """Read what `save_grid` wrote; FileError where it was changed without its fingerprint."""
    model = load_yaml_model(path, GridFile)
    walkable = walkable_of_picture(model.cells)
    if not walkable.any():
        raise FileError(f"{path}: cells must hold at least one {WALKABLE!r}, got none")
    grid = Grid(model.origin_m, model.cell_size_m, walkable)
    if grid.fingerprint() != model.fingerprint:
        raise FileError(
            f"{path}: fingerprint must be {grid.fingerprint()} for this grid, got"
            f" {model.fingerprint!r}; the file was edited: put that value in if you meant to"
        )
    return grid
