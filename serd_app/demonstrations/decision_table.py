"""Decisions (s, a, s', dwell time) as a CSV table, several as one, and the files beside a table.

The table is `NAME.csv`; what learning reads as well lies beside it: grid, record and scenario, and
the flow of people, whose table has a row per state of the grid, in order: the centre of the cell,
the flow (north, east, south, west or none) and the measurements that it was derived from.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from serd_app.errors import AppError
from serd_app.places.kept_scenario import keep_scenario, kept_scenario_file, own_scenario_yaml
from serd_bag.errors import FileError
from serd_bag.files import delete_file
from serd_bag.nearest import hint
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import TIMED_COLUMNS, TimedDecisions
from serd_core.errors import SerdError
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW
from serd_files.grid_file import load_grid, save_grid
from serd_files.table import Column, read_table, write_table
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model
from serd_sim.scenario.grid import flow_of, grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario

COLUMNS = (
    Column("episode", int),
    Column("time_s", float),
    Column("state", int),
    Column("action", int),
    Column("next_state", int),
    Column("dwell_s", float),
    Column("censored", int),
    Column("source", str),
)
_FLOW_COLUMNS = (
    Column("state", int),
    Column("x_m", float),
    Column("y_m", float),
    Column("flow", str),
    Column("order", float),
    Column("count", int),
    Column("vx_mps", float),
    Column("vy_mps", float),
)
_FLOWS = {"none": NO_FLOW} | {action.name.lower(): int(action) for action in list(Action)[1:]}
_NAMES = {flow: name for name, flow in _FLOWS.items()}
_LABEL = ", episodes"


def save_decisions(path: str | Path, decisions: TimedDecisions) -> None:
    """Write one line per decision below a line of column names; censored: 0 or 1."""
    numbers = [getattr(decisions, each.name).astype(each.kind).tolist() for each in COLUMNS[:-1]]
    rows = ((*row, decisions.source) for row in zip(*numbers, strict=True))
    write_table(path, COLUMNS, rows)


def load_decisions(path: str | Path) -> TimedDecisions:
    """Read what `save_decisions` wrote; FileError names the line and the column of a fault."""
    rows = read_table(path, COLUMNS, fix="make the table of decisions by 'serd demos'")
    try:
        return TimedDecisions(
            **{
                each.name: np.array([row[each.name] for row in rows], dtype=each.kind)
                for each in COLUMNS[:-1]
            },
            source="; ".join(dict.fromkeys(row["source"] for row in rows)),
        )
    except SerdError as error:
        raise FileError(f"{path}: {error}") from None


def concatenate(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows of several tables, one after the other; episodes keep their numbers."""
    columns = {
        name: np.concatenate([getattr(each, name) for each in tables]) for name in TIMED_COLUMNS
    }
    sources = dict.fromkeys(each.source for each in tables)
    return TimedDecisions(**columns, source="; ".join(sources))


def concatenate_renumbered(tables: Sequence[TimedDecisions]) -> TimedDecisions:
    """All rows in the order given; episodes of later tables are numbered on from the last.

    Episodes keep their numbers in the first table; within each table their order is kept. Where
    the sources differ, the source of the result names the episodes of each.
    """
    if not tables:
        raise AppError("tables must hold at least one table of decisions, got none")
    episodes, following = [], 0
    for table in tables:
        shift = max(0, following - int(table.episode.min(initial=following)))
        episodes.append(table.episode + shift)
        following = max(following, int(episodes[-1].max(initial=-1)) + 1)
    found = replace(concatenate(tables), episode=np.concatenate(episodes))
    sources = [table.source for table in tables]
    if len(set(sources)) == 1:
        return found
    for row, numbers in enumerate(episodes):
        if len(numbers) and _LABEL not in sources[row]:
            sources[row] += f"{_LABEL} {numbers.min()} to {numbers.max()}"
    return replace(found, source="; ".join(sources))


@dataclass(frozen=True, eq=False)
class Place:
    """The grid of decisions, and when they end; scenario: None where the grid was fitted.

    patience_s, wait_s: see `DecisionEpochs`. has_walls: whether the edge of the grid is that of a
    stated area; else a fitted grid ends where the robot went.
    """

    grid: Grid
    patience_s: float
    wait_s: float
    scenario: Scenario | None = None
    has_walls: bool = False

    @property
    def flow(self) -> IntArray | None:
        """(S,) the scenario's own."""
        return flow_of(self.scenario, self.grid) if self.scenario else None


class DemonstrationRecord(StrictModel):
    """The file beside a table that states where its decisions were made, and when they end.

    scenario: empty where the grid was fitted; patience_s, wait_s, has_walls: see `Place`.
    """

    remade_by: ClassVar[str] = "run 'serd demos' again"

    format: Literal["serd-demonstrations"] = "serd-demonstrations"
    format_version: Literal[2] = 2
    scenario: str
    grid_fingerprint: str
    patience_s: float = Field(gt=0)
    wait_s: float = Field(gt=0)
    has_walls: bool = False


def save_learnable(table: Path, place: Place, decisions: TimedDecisions) -> None:
    """Write a table of decisions with what `serd learn` needs beside it: grid, record, scenario."""
    files, scenario = files_beside(table), place.scenario
    # First, as an edited file is not replaced.
    keep_scenario(table, own_scenario_yaml(scenario) if scenario else "")
    save_decisions(table, decisions)
    record = DemonstrationRecord(
        scenario=scenario.name if scenario else "",
        grid_fingerprint=place.grid.fingerprint(),
        patience_s=place.patience_s,
        wait_s=place.wait_s,
        has_walls=place.has_walls,
    )
    save_grid(files["grid"], place.grid, record.scenario)
    save_yaml_model(files["record"], record)
    delete_file(files["flow"])  # of other recordings


def load_learnable(table: Path, scenario: str = "") -> tuple[TimedDecisions, Place]:
    """Read what `save_learnable` wrote; FileError where the files are not of one place.

    scenario: name or file, in place of the one that is kept beside the table or that it names.
    """
    files = files_beside(table)
    decisions = load_decisions(table)
    for path in (files["grid"], files["record"]):
        if not path.exists():
            raise FileError(
                f"{table}: {path.name}, which is written with it, must be beside it; move it there,"
                " or make both again"
            )
    grid = load_grid(files["grid"])
    record = load_yaml_model(files["record"], DemonstrationRecord)
    kept = str(files["scenario"]) if files["scenario"].is_file() else record.scenario
    name = scenario or kept
    known = load_scenario(name) if name else None
    place = Place(grid, record.patience_s, record.wait_s, known, record.has_walls)
    if record.grid_fingerprint != grid.fingerprint():
        raise FileError(
            f"{files['grid']} must be the grid of {files['record']}, but it is another;"
            " run 'serd demos' again"
        )
    if place.scenario is not None:
        _require_of_scenario(files, place, place.scenario)
    if not len(decisions):
        raise FileError(f"{table} must have at least one decision, got none; record more")
    highest = int(max(decisions.state.max(), decisions.next_state.max()))
    if highest >= grid.n_states:
        raise FileError(
            f"{table}: states must be below {grid.n_states}, the number of cells of the grid"
            f" beside it, got {highest}; run 'serd demos' again"
        )
    return decisions, place


def _require_of_scenario(files: dict[str, Path], place: Place, scenario: Scenario) -> None:
    if grid_of(scenario).fingerprint() != place.grid.fingerprint():
        raise FileError(
            f"{files['grid']} must be the grid of the scenario {scenario.name!r}, but it is"
            " another; run 'serd demos' with this scenario"
        )
    for name in ("patience_s", "wait_s"):
        wanted, recorded = getattr(scenario, name), getattr(place, name)
        if wanted != recorded:
            raise FileError(
                f"{files['record']}: {name} must be {wanted:g} as in the scenario, got"
                f" {recorded:g}; run 'serd demos' again"
            )


@dataclass(frozen=True, eq=False)
class FlowField:
    """In which direction people walk in each state, and what it was derived from.

    flow: (S,) an `Action` or -1 for none; mean_velocity_mps: (S, 2); order: (S,) 0 to 1; count:
    (S,) how many were seen.
    """

    flow: IntArray
    mean_velocity_mps: FloatArray
    order: FloatArray
    count: IntArray


def save_flow(path: str | Path, grid: Grid, field: FlowField) -> None:
    """Write the flow of people beside a table of decisions, one line per state."""
    names = [_NAMES[each] for each in field.flow.tolist()]
    numbers = field.order.round(4).tolist(), field.count.tolist()
    centers, velocities = grid.centers_m.T, field.mean_velocity_mps.round(4).T
    columns = *centers.tolist(), names, *numbers, *velocities.tolist()
    write_table(path, _FLOW_COLUMNS, zip(range(grid.n_states), *columns, strict=True))


def load_flow(path: str | Path, grid: Grid) -> IntArray:
    """(S,) the direction in each state, -1 for none; FileError where it is of another grid."""
    table = read_table(path, _FLOW_COLUMNS)
    if len(table) != grid.n_states:
        raise FileError(
            f"{path}: must have one line for each of the grid's {grid.n_states} states, got"
            f" {len(table)}; it was made for another grid"
        )
    for line, name in enumerate((row["flow"] for row in table), start=2):
        if name not in _FLOWS:
            raise FileError(
                f"{path}: line {line}, flow must be a direction or none, got {name!r}"
                f"; {hint(name, _FLOWS)}"
            )
    centers_m = np.array([(row["x_m"], row["y_m"]) for row in table])
    apart = np.abs(centers_m - grid.centers_m).max(axis=1) > 1e-6 * grid.cell_size_m
    if apart.any():
        state = int(np.argmax(apart))
        raise FileError(
            f"{path}: line {state + 2} must be the cell at {tuple(grid.centers_m[state].tolist())},"
            f" got {tuple(centers_m[state].tolist())}; it was made for another grid"
        )
    return np.array([_FLOWS[row["flow"]] for row in table], dtype=np.int64)


def files_beside(table: Path) -> dict[str, Path]:
    """Where everything is that belongs to a table of decisions, by what it is."""
    return {
        "decisions": table,
        "grid": table.with_suffix(".grid.yaml"),
        "record": table.with_suffix(".yaml"),
        "scenario": kept_scenario_file(table),
        "picture": table.with_suffix(".png"),
        "flow": table.with_suffix(".flow.csv"),
        "flow picture": table.with_suffix(".flow.png"),
    }
