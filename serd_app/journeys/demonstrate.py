"""From recordings to the table of decisions that learning starts from: what `serd demos` does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import shapely

from serd_app.demonstrations.discretise import OFF_GRID
from serd_app.demonstrations.fitted_grid import (
    USUAL_WAIT_S,
    fitted_grid,
    fitting_cell_size_m,
    fitting_patience_s,
    grid_of_area,
)
from serd_app.demonstrations.flow_field import FlowField
from serd_app.demonstrations.recorded import (
    Place,
    RecordedDemonstrations,
    Recordings,
    demonstrations_of_all,
    files_beside,
    read_mapping,
    read_recordings,
    save_demonstrations,
)
from serd_app.drives.recording import is_table
from serd_app.errors import AppError
from serd_app.places.free_area import read_area_m, require_area_file
from serd_app.report.pictures import save_pictures_of_demonstrations
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario


@dataclass(frozen=True)
class PlaceChoice:
    """Where recordings were made: a scenario by name or file, or a grid that is fitted to them.

    cell_size_m: side of the cells of a fitted grid, None for one that fits how the robot drives.
    area: file of what is walkable, None for where the robot was. AppError where a scenario and one
    of these are given.
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
class Demonstrated:
    """Decisions of recordings, in files.

    found: what each recording gives. flow: of people, None where none were recorded. files: those
    that were written, by what they are; missing: why no picture was drawn, empty where one was.
    """

    place: Place
    found: Sequence[RecordedDemonstrations]
    flow: FlowField | None
    files: dict[str, Path]
    missing: str = ""


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
    area_m = read_area_m(choice.area) if choice.area else None
    recordings = read_recordings(
        paths,
        mapping=read_mapping(mapping, paths),
        scenario=scenario,
        tolerant=tolerant,
        hidden=hidden,
    )
    if choice == PlaceChoice():
        _require_no_own(recordings)
    place = _place(recordings, scenario, choice.cell_size_m, area_m)
    found = demonstrations_of_all(recordings.all, place.grid, place.patience_s, place.wait_s)
    _require_decisions(found)
    flow = recordings.flow(place.grid)
    save_demonstrations(output, place, found, flow)
    missing = save_pictures_of_demonstrations(output, place, found, flow)
    files = {name: path for name, path in files_beside(output).items() if path.exists()}
    return Demonstrated(place, found, flow, files, missing)


def _place(
    recordings: Recordings,
    scenario: Scenario | None,
    cell_size_m: float | None,
    area_m: shapely.Polygon | None,
) -> Place:
    """Of a scenario, else with a grid that is fitted to where the robot was, or of an area."""
    if scenario:
        return Place(grid_of(scenario), scenario.patience_s, scenario.wait_s, scenario)
    drives = [drive for each in recordings.all for drive in each.drives]
    size_m = cell_size_m or fitting_cell_size_m(drives)
    grid = fitted_grid(recordings.all, size_m) if area_m is None else grid_of_area(area_m, size_m)
    return Place(grid, fitting_patience_s(drives, size_m), USUAL_WAIT_S)


def _require_decisions(found: Sequence[RecordedDemonstrations]) -> None:
    if not any(len(each.decisions) for each in found):
        counts = "; ".join(f"{each.bag}: {each.report}" for each in found)
        outside = any(OFF_GRID in each.report.dropped for each in found)
        fix = "is it this scenario?" if outside else "'serd bag check' lists what they hold"
        raise AppError(f"there is no decision to learn from in {counts}; {fix}")


def _require_no_own(recordings: Recordings) -> None:
    """AppError for a recording of ours, which was made in a scenario."""
    for each in recordings.all if recordings.mapping is None else ():
        if not is_table(each.bag):
            raise AppError(
                f"either --scenario or --cell-size-m must be given for {each.bag}, got neither;"
                " give the scenario that it was recorded in"
            )
