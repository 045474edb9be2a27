"""Demonstrations of several recordings: decisions on one grid, tracks, counts, and their files.

The table of decisions is `NAME.csv`; what learning reads as well lies beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from serd_app.demonstrations.decision_table import concatenate_renumbered, save_decisions
from serd_app.demonstrations.demonstrations import demonstrations_of_each, joined_demonstrations
from serd_app.demonstrations.discretise import DiscretisationReport, joined_reports
from serd_app.demonstrations.grid.flow_field import FlowField, save_flow
from serd_app.demonstrations.grid.resolution import (
    ResolutionAdvice,
    ResolutionRow,
    resolution_advice,
)
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.recording import Recording
from serd_app.drives.table_drives import is_table
from serd_app.places.kept_scenario import keep_scenario, kept_scenario_file, own_scenario_yaml
from serd_bag.files import delete_file
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.grid import Grid
from serd_files.grid_file import save_grid
from serd_files.table import read_rows, write_rows
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model
from serd_sim.scenario.grid import flow_of
from serd_sim.scenario.scenario import Scenario


class _Bag(StrictModel):
    """The first key of `BagRecord`: fields of the last base class come first."""

    bag: str


class BagRecord(DiscretisationReport, _Bag):
    """What became of the intents of one bag.

    damage: sentences about what of the bag could not be read; n_lost: messages known to be lost;
    all_lost_known: whether that is all of them.
    """

    damage: tuple[str, ...] = ()
    n_lost: int = Field(0, ge=0)
    all_lost_known: bool = True


class MotionRecord(StrictModel):
    """See `ResolutionAdvice`."""

    speed_mps: float
    fast_mps: float
    turning: float


class DemonstrationRecord(StrictModel):
    """scenario: empty where the grid was fitted; goal_entry_s: see `ModelFile`. motion: None where
    the robot never moves a whole period."""

    format: Literal["serd-demonstrations"] = "serd-demonstrations"
    format_version: Literal[1] = 1
    scenario: str
    grid_fingerprint: str
    decision_period_s: float = Field(gt=0)
    goal_entry_s: tuple[Annotated[float, Field(gt=0)], ...] = ()
    bags: tuple[BagRecord, ...]
    motion: MotionRecord | None = None


@dataclass(frozen=True, eq=False)
class RecordedDemonstrations:
    """What one recording gives; tracks_m: (T, 2) robot positions of each episode that counts.

    goal_entry_s: see `serd_files.model_file.ModelFile`. n_of_drives: decisions of each drive.
    """

    recording: Recording
    decisions: Decisions
    report: DiscretisationReport
    tracks_m: tuple[FloatArray, ...]
    goal_entry_s: tuple[float, ...]
    n_of_drives: tuple[int, ...]

    @property
    def bag(self) -> Path:
        """Where it was read from."""
        return self.recording.bag

    def values(self) -> dict[str, Any]:
        """The counts and the damage, as plain values."""
        return {
            "bag": str(self.bag),
            **self.report.model_dump(),
            "n_intents": self.report.n_intents,
            "fault_share": self.report.fault_share,
            **self.recording.values(),
        }


@dataclass(frozen=True, eq=False)
class Place:
    """The grid decisions are cut on; scenario: None where it was fitted."""

    grid: Grid
    period_s: float
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
    recordings: Sequence[Recording], grid: Grid, period_s: float
) -> list[RecordedDemonstrations]:
    """Their decisions on a grid; an episode that several of them hold counts in the first."""
    seen: set[bytes] = set()
    found = []
    for each in recordings:
        agents = each.crowd is not None or is_table(each.bag)
        parts = demonstrations_of_each(each.drives, grid, period_s, seen, agents=agents)
        here, report = joined_demonstrations(parts)
        n_of_drives = tuple(len(part.decisions) for part, _ in parts)
        tracks = tuple(track for drive in each.drives for track in tracks_of(drive, grid))
        found.append(
            RecordedDemonstrations(
                each, here.decisions, report, tracks, here.goal_entry_s, n_of_drives
            )
        )
    return found


def tracks_of(drive: RecordedDrive, grid: Grid) -> tuple[FloatArray, ...]:
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


def concatenated(found: Sequence[RecordedDemonstrations]) -> Decisions:
    """The decisions of all recordings; episodes are numbered on."""
    return concatenate_renumbered([each.decisions for each in found])


def advice_of_all(found: Sequence[RecordedDemonstrations], place: Place) -> ResolutionAdvice | None:
    """On cell size and period, by all recordings."""
    drives = [drive for each in found for drive in each.recording.drives]
    grid = place.grid
    return resolution_advice(drives, grid.cell_size_m, place.period_s, origin_m=grid.origin_m)


def save_demonstrations(
    output: Path,
    place: Place,
    found: Sequence[RecordedDemonstrations],
    flow: FlowField | None,
    advice: ResolutionAdvice | None = None,
) -> None:
    """Write table, grid, record, flow and advice side by side; see `files_beside`."""
    files = files_beside(output)
    save_learnable(
        output,
        place,
        concatenated(found),
        tuple(entry_s for each in found for entry_s in each.goal_entry_s),
        bags=tuple(
            BagRecord(**{name: values[name] for name in BagRecord.model_fields})
            for values in (each.values() for each in found)
        ),
        motion=MotionRecord.model_validate(advice, from_attributes=True) if advice else None,
    )
    if advice is not None:
        write_rows(files["resolution"], ResolutionRow, advice.rows)
    if flow is not None:
        save_flow(files["flow"], place.grid, flow)


def save_learnable(
    output: Path,
    place: Place,
    decisions: Decisions,
    goal_entry_s: tuple[float, ...],
    *,
    bags: tuple[BagRecord, ...] = (),
    motion: MotionRecord | None = None,
) -> None:
    """Write a table of decisions with what `serd learn` needs beside it: grid, record, scenario."""
    files = files_beside(output)
    # First, as an edited file is not replaced.
    keep_scenario(output, own_scenario_yaml(place.scenario) if place.scenario else "")
    save_decisions(files["decisions"], decisions)
    save_grid(files["grid"], place.grid, place.name)
    record = DemonstrationRecord(
        scenario=place.name,
        grid_fingerprint=place.grid.fingerprint(),
        decision_period_s=place.period_s,
        goal_entry_s=goal_entry_s,
        bags=bags,
        motion=motion,
    )
    save_yaml_model(files["record"], record)
    for name in ("flow", "crossings", "resolution", "resolution picture"):  # of other recordings
        delete_file(files[name])


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
        "crossings": table.with_suffix(".crossings.csv"),
        "resolution": table.with_suffix(".resolution.csv"),
        "resolution picture": table.with_suffix(".resolution.png"),
    }


def load_advice(table: Path) -> ResolutionAdvice | None:
    """The advice of the recordings of a table, None where they have none."""
    files = files_beside(table)
    motion = load_yaml_model(files["record"], DemonstrationRecord).motion
    if motion is None:
        return None
    rows = read_rows(files["resolution"], ResolutionRow)
    return ResolutionAdvice(rows, **motion.model_dump())


def report_of_table(table: Path) -> DiscretisationReport | None:
    """That of the recordings of a table of decisions; None where its record has none."""
    record = files_beside(table)["record"]
    bags = load_yaml_model(record, DemonstrationRecord).bags if record.exists() else ()
    return joined_reports(bags) if bags else None
