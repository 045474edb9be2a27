"""From recordings to the table of decisions that learning starts from: what `serd demos` does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from serd_app.demonstrations.decision_table import (
    FlowField,
    Place,
    concatenate_renumbered,
    files_beside,
    save_flow,
    save_learnable,
)
from serd_app.demonstrations.discretise import (
    OFF_GRID,
    DiscretisationReport,
    demonstrations_of_drives,
)
from serd_app.demonstrations.fitted_grid import (
    USUAL_WAIT_S,
    fitted_grid,
    fitting_cell_size_m,
    fitting_patience_s,
    grid_of_area,
)
from serd_app.demonstrations.flow_field import flow_from_recordings
from serd_app.demonstrations.suggest import suggest_mapping
from serd_app.drives.drive import RecordedDrive
from serd_app.drives.mapping import BagMapping
from serd_app.drives.recording import Recording, read_mapping, read_recording
from serd_app.errors import AppError, MappingError
from serd_app.learning.settings import LearningSettings
from serd_app.places.free_area import read_area_m, require_area_file, stated_area_m
from serd_bag.files import delete_file
from serd_bag.quantities import counted
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import TimedDecisions, state_counts
from serd_core.grid.grid import Grid
from serd_files.errors import USER_ERRORS, missing_pictures
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario

#: Shares of the size of cells that are tried where there are too few decisions.
_FINER = 0.7, 0.5, 0.35


@dataclass(frozen=True)
class PlaceChoice:
    """Where recordings were made: a scenario by name or file, or a grid that is fitted to them.

    cell_size_m: side of the cells of a fitted grid, None for one that fits how the robot drives.
    area: file of what is walkable, None for what an archive states, else where the robot was.
    AppError where a scenario and one of these are given.
    """

    scenario: str = ""
    cell_size_m: float | None = None
    area: Path | None = None

    def __post_init__(self) -> None:
        for name, value in (("--cell-size-m", self.cell_size_m), ("--area", self.area)):
            if self.scenario and value is not None:
                raise AppError(
                    f"either --scenario or {name} must be given, got both; give --scenario where"
                    " there is one"
                )
        if self.area is not None:
            require_area_file(self.area)
        size_m = self.cell_size_m
        if size_m is not None and not 0 < size_m < math.inf:
            raise AppError(f"--cell-size-m must be finite and above 0, got {size_m:g}; try 1")


@dataclass(frozen=True, eq=False)
class RecordedDemonstrations:
    """What one recording gives."""

    recording: Recording
    decisions: TimedDecisions
    report: DiscretisationReport

    @property
    def bag(self) -> Path:
        """Where it was read from."""
        return self.recording.bag

    def values(self) -> dict[str, Any]:
        """The counts and the damage, as plain values."""
        recording = self.recording
        return {
            "bag": str(self.bag),
            **self.report.model_dump(),
            "fault_share": self.report.fault_share,
            "damage": list(recording.damage),
            "n_lost": recording.losses.n_messages,
            "all_lost_known": recording.losses.all_known,
            "assumed": list(recording.assumed),
        }


@dataclass(frozen=True, eq=False)
class Demonstrated:
    """Decisions of recordings, in files.

    found: what each recording gives. flow: of people, None where none were recorded. files: those
    that were written, by what they are; missing: why no picture was drawn, empty where one was.
    too_few: that there are too few decisions to learn from, with an option that gives enough.
    """

    place: Place
    found: Sequence[RecordedDemonstrations]
    flow: FlowField | None
    files: dict[str, Path]
    missing: str = ""
    too_few: str = ""


def demonstrate(
    paths: Sequence[Path],
    output: Path,
    choice: PlaceChoice,
    *,
    mapping: Path | None = None,
    tolerant: bool = False,
    hidden: bool = False,
) -> Demonstrated:
    """Read bags or tables, put them on a grid, and write decisions, grid, flow and pictures.

    output: the table; the others lie beside it. mapping: file of topics or columns. tolerant: use
    what damaged bags still hold. hidden: learn from poses alone. SerdError or FileError where a
    file is missing or wrong, or where there is no decision.
    """
    scenario = load_scenario(choice.scenario) if choice.scenario else None
    area_m = None
    if scenario is None:
        area_m = read_area_m(choice.area) if choice.area else stated_area_m(paths)
    known = read_mapping(mapping, paths)
    goal_area_m = scenario.goal_area_m if scenario else ()
    options = {"mapping": known, "tolerant": tolerant, "hidden": hidden, "goal_area_m": goal_area_m}
    recordings = [_read(path, **options) for path in paths]
    if choice == PlaceChoice() and known is None:
        _require_no_own(recordings)
    place = _place(recordings, scenario, choice.cell_size_m, area_m)
    found = _decided(recordings, place)
    people = known if isinstance(known, BagMapping) else BagMapping()
    flow = flow_from_recordings(
        recordings, place.grid, people.people_topic, frame=people.frame, tolerant=tolerant
    )
    decisions = concatenate_renumbered([each.decisions for each in found])
    save_learnable(output, place, decisions)
    beside = files_beside(output)
    if flow is not None:
        save_flow(beside["flow"], place.grid, flow)
    missing = missing_pictures()
    if not missing:
        _save_pictures(beside, place, decisions, recordings, flow)
    files = {name: path for name, path in beside.items() if path.exists()}
    too_few = _finer_cells(recordings, place, area_m, len(decisions))
    return Demonstrated(place, found, flow, files, missing, too_few)


def _read(path: Path, **options: Any) -> Recording:
    """A recording; where no mapping can read it, the error states why in place of a remedy."""
    try:
        return read_recording(path, **options)
    except MappingError as error:
        try:
            suggest_mapping(path)
        except USER_ERRORS as reason:
            raise AppError(f"{error.sentence}; no mapping reads it: {reason}") from None
        raise


def _finer_cells(
    recordings: Sequence[Recording],
    place: Place,
    area_m: shapely.Polygon | None,
    n_decisions: int,
) -> str:
    """The command option that gives enough decisions to learn from, or that none does; empty where
    there are enough, or the cells are those of a scenario."""
    needed = LearningSettings().minimum_decisions
    if n_decisions >= needed or place.scenario is not None:
        return ""
    few = f"{counted(n_decisions, 'decision')} are too few to learn from ({needed})"
    for share in _FINER:
        size_m = round(share * place.grid.cell_size_m, 3)
        try:
            finer = _place(recordings, None, size_m, area_m)
            n_finer = sum(len(each.decisions) for each in _decided(recordings, finer))
        except AppError:
            continue
        if n_finer >= needed:
            return f"{few}; --cell-size-m {size_m:g} gives {n_finer}"
    return f"{few}, and smaller cells give no more than that: record more drives"


def _place(
    recordings: Sequence[Recording],
    scenario: Scenario | None,
    cell_size_m: float | None,
    area_m: shapely.Polygon | None,
) -> Place:
    """Of a scenario, else with a grid that is fitted to where the robot was, or of an area."""
    if scenario:
        return Place(grid_of(scenario), scenario.patience_s, scenario.wait_s, scenario)
    drives = [drive for each in recordings for drive in each.drives]
    size_m = cell_size_m or fitting_cell_size_m(drives)
    grid = fitted_grid(recordings, size_m) if area_m is None else grid_of_area(area_m, size_m)
    patience_s = fitting_patience_s(drives, size_m)
    return Place(grid, patience_s, USUAL_WAIT_S, has_walls=area_m is not None)


def _decided(recordings: Sequence[Recording], place: Place) -> list[RecordedDemonstrations]:
    """What each recording gives on the grid of the place; AppError where that is no decision.

    An episode that several recordings hold counts in the first.
    """
    seen: set[bytes] = set()
    found = []
    for each in recordings:
        decisions, report = demonstrations_of_drives(
            each.drives, place.grid, place.patience_s, place.wait_s, seen=seen, agents=each.of_table
        )
        found.append(RecordedDemonstrations(each, decisions, report))
    if not any(len(each.decisions) for each in found):
        counts = "; ".join(f"{each.bag}: {each.report}" for each in found)
        outside = any(OFF_GRID in each.report.dropped for each in found)
        fix = "is it this scenario?" if outside else "'serd bag check' lists what they hold"
        raise AppError(f"there is no decision to learn from in {counts}; {fix}")
    return found


def _require_no_own(recordings: Sequence[Recording]) -> None:
    """AppError for a recording of ours, which was made in a scenario."""
    for each in recordings:
        if not each.of_table:
            raise AppError(
                f"either --scenario or --cell-size-m must be given for {each.bag}, got neither;"
                " give the scenario that it was recorded in"
            )


def _save_pictures(
    files: dict[str, Path],
    place: Place,
    decisions: TimedDecisions,
    recordings: Sequence[Recording],
    flow: FlowField | None,
) -> None:
    """Draw the tracks, and the flow of people where there is one, beside the table."""
    from serd_app.report.maps import draw_flow_map, draw_visitation
    from serd_app.report.style import save_figure

    grid, scenario = place.grid, place.scenario
    drives = (drive for each in recordings for drive in each.drives)
    tracks_m = [track_m for drive in drives for track_m in _tracks_m(drive, grid)]
    visits = state_counts(decisions, grid.n_states)
    save_figure(files["picture"], draw_visitation(scenario, grid, visits, tracks_m))
    if flow is None:
        delete_file(files["flow picture"])
        return
    figure = draw_flow_map(grid, flow.flow, flow.order, scenario=scenario, scenario_flow=place.flow)
    save_figure(files["flow picture"], figure)


def _tracks_m(drive: RecordedDrive, grid: Grid) -> list[FloatArray]:
    """(T, 2) positions within each episode that demonstrates something.

    NaN farther off the grid than it is large, which no picture of it could show.
    """
    size_m = np.array(grid.walkable.shape[::-1]) * grid.cell_size_m
    from_middle_m = np.abs(drive.position_m - (grid.origin_m + size_m / 2))
    near = (from_middle_m < 1.5 * size_m).all(axis=1, keepdims=True)
    time_s, position_m = drive.pose_time_s, np.where(near, drive.position_m, np.nan)
    return [
        position_m[(time_s >= span.start_s) & (time_s <= span.end_s)]
        for span in drive.episodes
        if span.demonstrates
    ]
