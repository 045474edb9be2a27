"""The grid as a YAML file with a picture of it in characters, north up."""

from pathlib import Path
from typing import Literal

from pydantic import Field, field_validator

from serd_bag.errors import FileError
from serd_core.grid.grid import Grid
from serd_files.grid_picture import BLOCKED, WALKABLE, walkable_of_picture, walkable_picture
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model


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
