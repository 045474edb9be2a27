"""Recordings of one place, their decisions on one grid, tracks and counts, and the files of these.

The table of decisions is `NAME.csv`; what learning reads as well lies beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from serd_app.demonstrations.decision_table import concatenate_renumbered, save_decisions
from serd_app.demonstrations.discretise import (
    DiscretisationReport,
    demonstrations_of_drives,
)
from serd_app.demonstrations.flow_field import FlowField, flow_from_recordings, save_flow
from serd_app.drives.drive import RecordedDrive
from serd_app.drives.mapping import BagMapping, DriveMapping, TableMapping
from serd_app.drives.recording import Recording, is_table, read_recording
from serd_app.errors import AppError
from serd_app.places.kept_scenario import keep_scenario, kept_scenario_file, own_scenario_yaml
from serd_bag.files import delete_file
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Grid
from serd_files.grid_file import save_grid
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model
from serd_sim.scenario.grid import flow_of
from serd_sim.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Recordings:
    """all: one of each bag or table; mapping: None for tables or bags of our recorder."""

    all: tuple[Recording, ...]
    mapping: DriveMapping | None
    tolerant: bool

    def flow(self, grid: Grid) -> FlowField | None:
        """In which direction people walk in them; None where there are none."""
        people = self.mapping if isinstance(self.mapping, BagMapping) else BagMapping()
        return flow_from_recordings(
            self.all, grid, people.people_topic, frame=people.frame, tolerant=self.tolerant
        )


def read_mapping(file: Path | None, paths: Sequence[Path]) -> DriveMapping | None:
    """The mapping of a file, for bags or for tables; None without a file or without paths."""
    if file is None or not paths:
        return None
    kinds = {TableMapping if is_table(each) else BagMapping for each in paths}
    if len(kinds) > 1:
        raise AppError(f"--mapping must be for bags or for tables, got {file} for both")
    return load_yaml_model(file, kinds.pop())


def read_recordings(
    paths: Sequence[Path],
    *,
    mapping: DriveMapping | None,
    scenario: Scenario | None,
    tolerant: bool = False,
    hidden: bool = False,
) -> Recordings:
    """Bags or tables. Options: as of `read_recording`."""
    goal_area_m = scenario.goal_area_m if scenario else ()
    recordings = (
        read_recording(
            each, mapping=mapping, tolerant=tolerant, hidden=hidden, goal_area_m=goal_area_m
        )
        for each in paths
    )
    return Recordings(tuple(recordings), mapping, tolerant)


class DemonstrationRecord(StrictModel):
    """scenario: empty where the grid was fitted; patience_s, wait_s: see `DecisionEpochs`."""

    remade_by: ClassVar[str] = "run 'serd demos' again"

    format: Literal["serd-demonstrations"] = "serd-demonstrations"
    format_version: Literal[2] = 2
    scenario: str
    grid_fingerprint: str
    patience_s: float = Field(gt=0)
    wait_s: float = Field(gt=0)


@dataclass(frozen=True, eq=False)
class RecordedDemonstrations:
    """What one recording gives; tracks_m: (T, 2) robot positions of each episode that counts."""

    recording: Recording
    decisions: TimedDecisions
    report: DiscretisationReport
    tracks_m: tuple[FloatArray, ...]

    @property
    def bag(self) -> Path:
        """Where it was read from."""
        return self.recording.bag

    def values(self) -> dict[str, Any]:
        """The counts and the damage, as plain values."""
        return {
            "bag": str(self.bag),
            **self.report.model_dump(),
            "fault_share": self.report.fault_share,
            **self.recording.values(),
        }


@dataclass(frozen=True, eq=False)
class Place:
    """The grid of decisions, and when they end; scenario: None where the grid was fitted.

    patience_s, wait_s: see `DecisionEpochs`.
    """

    grid: Grid
    patience_s: float
    wait_s: float
    scenario: Scenario | None = None

    @property
    def name(self) -> str:
        """Of the scenario, empty where there is none."""
        return self.scenario.name if self.scenario else ""

    @property
    def flow(self) -> IntArray | None:
        """(S,) the scenario's own."""
        return flow_of(self.scenario, self.grid) if self.scenario else None


def demonstrations_of_all(
    recordings: Sequence[Recording], grid: Grid, patience_s: float, wait_s: float
) -> list[RecordedDemonstrations]:
    """Their decisions on a grid; an episode that several of them hold counts in the first."""
    seen: set[bytes] = set()
    found = []
    for each in recordings:
        decisions, report = demonstrations_of_drives(
            each.drives, grid, patience_s, wait_s, seen=seen, agents=is_table(each.bag)
        )
        tracks = tuple(track for drive in each.drives for track in _tracks_of(drive, grid))
        found.append(RecordedDemonstrations(each, decisions, report, tracks))
    return found


def _tracks_of(drive: RecordedDrive, grid: Grid) -> tuple[FloatArray, ...]:
    """(T, 2) positions within each episode that demonstrates something.

    NaN farther off the grid than it is large, which no picture of it could show.
    """
    size_m = np.array(grid.walkable.shape[::-1]) * grid.cell_size_m
    from_middle_m = np.abs(drive.position_m - (grid.origin_m + size_m / 2))
    near = np.asarray((from_middle_m < 1.5 * size_m).all(axis=1))
    time_s, position_m = drive.pose_time_s, np.where(near.reshape(-1, 1), drive.position_m, np.nan)
    return tuple(
        position_m[(time_s >= span.start_s) & (time_s <= span.end_s)]
        for span in drive.episodes
        if span.demonstrates
    )


def concatenated(found: Sequence[RecordedDemonstrations]) -> TimedDecisions:
    """The decisions of all recordings; episodes are numbered on."""
    return concatenate_renumbered([each.decisions for each in found])


def save_demonstrations(
    output: Path,
    place: Place,
    found: Sequence[RecordedDemonstrations],
    flow: FlowField | None,
) -> None:
    """Write table, grid, record and flow side by side; see `files_beside`."""
    save_learnable(output, place, concatenated(found))
    if flow is not None:
        save_flow(files_beside(output)["flow"], place.grid, flow)


def save_learnable(output: Path, place: Place, decisions: TimedDecisions) -> None:
    """Write a table of decisions with what `serd learn` needs beside it: grid, record, scenario."""
    files = files_beside(output)
    # First, as an edited file is not replaced.
    keep_scenario(output, own_scenario_yaml(place.scenario) if place.scenario else "")
    save_decisions(files["decisions"], decisions)
    save_grid(files["grid"], place.grid, place.name)
    record = DemonstrationRecord(
        scenario=place.name,
        grid_fingerprint=place.grid.fingerprint(),
        patience_s=place.patience_s,
        wait_s=place.wait_s,
    )
    save_yaml_model(files["record"], record)
    delete_file(files["flow"])  # of other recordings


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
