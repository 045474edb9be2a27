"""Demonstrations out of recordings: decisions on the grid of a scenario, tracks, counts."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from report.figures.map_axes import layout_of
from report.figures.maps import draw_flow_map, draw_visitation
from report.style import png_bytes
from serd_app.demonstrations.concatenate import joined_decisions
from serd_app.demonstrations.decision_table import save_decisions
from serd_app.demonstrations.demonstrations import demonstrations_of_drives
from serd_app.demonstrations.discretise import DiscretisationReport
from serd_app.demonstrations.fitted_grid import grid_around
from serd_app.demonstrations.flow_field import FlowField
from serd_app.demonstrations.flow_table import save_flow
from serd_app.demonstrations.grid_file import save_grid
from serd_app.demonstrations.record import BagRecord, DemonstrationRecord, save_record
from serd_app.drives.episode_spans import DISCARDED
from serd_app.drives.recorded_drive import RecordedDrive
from serd_cli.errors import UsageError
from serd_cli.recording import Recording
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions, state_counts
from serd_core.grid.grid import Grid
from sim.scenario.grid import flow_of
from sim.scenario.scenario import Scenario
from storage.files import atomic_write_bytes


@dataclass(frozen=True, eq=False)
class RecordedDemonstrations:
    """What one recording gives; tracks_m: (T, 2) robot positions of each episode that counts.

    goal_entry_s: see `storage.model_file.ModelFile`.
    """

    recording: Recording
    decisions: Decisions
    report: DiscretisationReport
    tracks_m: tuple[FloatArray, ...]
    goal_entry_s: tuple[float, ...]

    @property
    def bag(self) -> Path:
        """Where it was read from."""
        return self.recording.bag

    def values(self) -> dict[str, Any]:
        """The counts and the damage, as plain values."""
        return {
            "bag": str(self.bag),
            **asdict(self.report),
            "n_intents": self.report.n_intents,
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
        here, report = demonstrations_of_drives(each.drives, grid, period_s, seen=seen)
        tracks = tuple(track for drive in each.drives for track in tracks_of(drive, grid))
        found.append(
            RecordedDemonstrations(each, here.decisions, report, tracks, here.goal_entry_s)
        )
    return found


def fitted_grid(recordings: Sequence[Recording], cell_size_m: float) -> Grid:
    """Cells wherever one of the robots has been, and around."""
    places = [drive.position_m for recording in recordings for drive in recording.drives]
    if not any(len(each) for each in places):
        names = ", ".join(str(recording.bag) for recording in recordings)
        raise UsageError(f"{names} must hold a pose to fit a grid to, got none; record some")
    return grid_around(np.concatenate(places), cell_size_m)


def tracks_of(drive: RecordedDrive, grid: Grid) -> tuple[FloatArray, ...]:
    """(T, 2) positions within each episode that was not discarded; NaN farther off the grid than
    it is large, which no picture of it could show."""
    size_m = np.array(grid.walkable.shape[::-1]) * grid.cell_size_m
    from_middle_m = np.abs(drive.position_m - (grid.origin_m + size_m / 2))
    near = np.asarray((from_middle_m < 1.5 * size_m).all(axis=1))
    time_s, position_m = drive.pose_time_s, np.where(near.reshape(-1, 1), drive.position_m, np.nan)
    return tuple(
        position_m[(time_s >= span.start_s) & (time_s <= span.end_s)]
        for span in drive.episodes
        if span.outcome != DISCARDED
    )


def save_demonstrations(
    output: Path,
    place: Place,
    found: Sequence[RecordedDemonstrations],
    flow: FlowField | None,
) -> dict[str, Path]:
    """Write table, grid, record and pictures side by side; their paths by what they are."""
    decisions = joined_decisions([each.decisions for each in found])
    files = files_beside(output)
    tracks = [track for each in found for track in each.tracks_m]
    visits = state_counts(decisions, place.grid.n_states)
    save_decisions(files["decisions"], decisions)
    save_grid(files["grid"], place.grid, place.name)
    save_record(files["record"], _record(place, found))
    layout = layout_of(place.scenario) if place.scenario else None
    figure = draw_visitation(layout, place.grid, visits, tracks)
    atomic_write_bytes(files["picture"], png_bytes(figure))
    if flow is None:  # that of other recordings must not stay beside this table
        for name in ("flow", "flow picture"):
            files.pop(name).unlink(missing_ok=True)
    else:
        _save_flow(files, place, flow)
    return files


def files_beside(table: Path) -> dict[str, Path]:
    """Where everything is that belongs to a table of decisions, by what it is."""
    return {
        "decisions": table,
        "grid": table.with_suffix(".grid.yaml"),
        "record": table.with_suffix(".yaml"),
        "picture": table.with_suffix(".png"),
        "flow": table.with_suffix(".flow.csv"),
        "flow picture": table.with_suffix(".flow.png"),
    }


def _record(place: Place, found: Sequence[RecordedDemonstrations]) -> DemonstrationRecord:
    return DemonstrationRecord(
        scenario=place.name,
        grid_fingerprint=place.grid.fingerprint(),
        decision_period_s=place.period_s,
        goal_entry_s=tuple(entry_s for each in found for entry_s in each.goal_entry_s),
        bags=tuple(_bag_record(each) for each in found),
    )


def _bag_record(found: RecordedDemonstrations) -> BagRecord:
    values = found.values()
    return BagRecord(**{name: values[name] for name in BagRecord.model_fields})


def _save_flow(files: dict[str, Path], place: Place, found: FlowField) -> None:
    save_flow(
        files["flow"],
        place.grid,
        flow=found.flow,
        order=found.order,
        count=found.count,
        mean_velocity_mps=found.mean_velocity_mps,
    )
    figure = draw_flow_map(
        place.grid,
        found.flow,
        found.order,
        layout=layout_of(place.scenario) if place.scenario else None,
        scenario_flow=place.flow,
    )
    atomic_write_bytes(files["flow picture"], png_bytes(figure))
