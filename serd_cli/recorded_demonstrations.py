"""Demonstrations out of recordings: decisions on the grid of a scenario, tracks, counts."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bags.discretise import LONGEST_GAP_S, DiscretisationReport, decisions_from_drive
from bags.fitted_grid import grid_around
from bags.joined_decisions import joined_decisions
from bags.mapped_drive import read_mapped_drive
from bags.mapping import BagMapping
from bags.recorded_drive import DISCARDED, RecordedDrive, read_drive
from report.canvas import png_bytes
from report.figures.fitted_visitation import draw_fitted_visitation
from report.figures.visitation import draw_visitation
from report.layout import layout_of
from serd_core.arrays import FloatArray
from serd_core.demonstrations import Decisions, state_counts
from serd_core.grid import Grid
from sim.scenario import Scenario
from storage.atomic import atomic_write_bytes
from storage.decision_table import save_decisions
from storage.grid_file import save_grid


@dataclass(frozen=True, eq=False)
class RecordedDemonstrations:
    """What one bag gives; tracks_m: (T, 2) robot positions of each episode that counts."""

    bag: Path
    decisions: Decisions
    report: DiscretisationReport
    tracks_m: tuple[FloatArray, ...]

    def values(self) -> dict[str, Any]:
        """The counts, as plain values."""
        counts = asdict(self.report)
        return {"bag": str(self.bag), **counts, "n_intents": self.report.n_intents}


@dataclass(frozen=True, eq=False)
class Recording:
    """What one bag holds; longest_gap_s: between poses across which places are interpolated."""

    bag: Path
    drive: RecordedDrive
    longest_gap_s: float


def read_recording(
    bag: Path, period_s: float, *, mapping: BagMapping | None, tolerant: bool
) -> Recording:
    """Our own recording, or with a mapping anybody's."""
    if mapping is None:
        return Recording(bag, read_drive(bag, tolerant=tolerant), LONGEST_GAP_S)
    return Recording(bag, read_mapped_drive(bag, mapping, period_s), mapping.longest_gap_s)


def demonstrations_of(recording: Recording, grid: Grid, period_s: float) -> RecordedDemonstrations:
    """Its decisions on a grid."""
    drive = recording.drive
    decisions, report = decisions_from_drive(
        drive, grid, period_s, longest_gap_s=recording.longest_gap_s
    )
    return RecordedDemonstrations(recording.bag, decisions, report, tracks_of(drive))


def fitted_grid(recordings: Sequence[Recording], cell_size_m: float) -> Grid:
    """Cells wherever one of the robots has been, and around."""
    places = [recording.drive.position_m for recording in recordings]
    return grid_around(np.concatenate(places), cell_size_m)


def tracks_of(drive: RecordedDrive) -> tuple[FloatArray, ...]:
    """(T, 2) positions within each episode that was not discarded."""
    time_s = drive.pose_time_s
    return tuple(
        drive.position_m[(time_s >= span.start_s) & (time_s <= span.end_s)]
        for span in drive.episodes
        if span.outcome != DISCARDED
    )


def save_demonstrations(
    output: Path, scenario: Scenario | None, grid: Grid, found: Sequence[RecordedDemonstrations]
) -> dict[str, Path]:
    """Write the table, the grid and the picture side by side; their paths by what they are.

    scenario: None where the grid was fitted.
    """
    decisions = joined_decisions([each.decisions for each in found])
    files = {
        "decisions": output,
        "grid": output.with_suffix(".grid.yaml"),
        "picture": output.with_suffix(".png"),
    }
    tracks = [track for each in found for track in each.tracks_m]
    visits = state_counts(decisions, grid.n_states)
    save_decisions(files["decisions"], decisions)
    save_grid(files["grid"], grid, scenario.name if scenario else "")
    if scenario is None:
        figure = draw_fitted_visitation(grid, visits, tracks)
    else:
        figure = draw_visitation(layout_of(scenario), grid, visits, tracks)
    atomic_write_bytes(files["picture"], png_bytes(figure))
    return files
