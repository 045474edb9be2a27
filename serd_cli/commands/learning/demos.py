"""`serd demos`: recordings into the table of decisions that learning starts from."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import shapely
import typer

from serd_app.demonstrations.discretise import OFF_GRID
from serd_app.demonstrations.grid.fitted_grid import fitted_grid, grid_of_area
from serd_app.demonstrations.grid.flow_field import FlowField, flow_from_recordings
from serd_app.demonstrations.grid.resolution import (
    USUAL_WAIT_S,
    fitting_cell_size_m,
    fitting_patience_s,
)
from serd_app.demonstrations.recorded import (
    Place,
    RecordedDemonstrations,
    demonstrations_of_all,
    files_beside,
    save_demonstrations,
)
from serd_app.demonstrations.recordings import Recordings, read_recordings
from serd_app.drives.mapped.mapping import BagMapping, TableMapping
from serd_app.drives.table_drives import is_table
from serd_app.places.free_area import read_area_m, require_area_file
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, require_apart, require_suffix
from serd_cli.output.demonstrations import (
    decisions_table,
    flow_in_words,
    flow_values,
    remarks,
    save_pictures,
)
from serd_cli.output.terminal import console, print_json
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario, load_scenario


def demos(
    bags: Annotated[
        list[Path],
        typer.Argument(
            metavar="BAG", help="bag folders, .mcap, .db3 or .bag files, or tables of trajectories"
        ),
    ],
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file they were recorded in")
    ] = "",
    cell_size_m: Annotated[
        float | None,
        typer.Option(
            help="without a scenario: side of the cells of a grid fitted to where the robot was;"
            " by default as it moves"
        ),
    ] = None,
    area: Annotated[
        Path | None,
        typer.Option(
            help="without a scenario: walkable area in place of where the robot was, .wkt or"
            " .geojson in metres"
        ),
    ] = None,
    output: Annotated[Path, typer.Option(help="table to write, ending in .csv")] = Path(
        "decisions.csv"
    ),
    mapping: Annotated[
        Path | None,
        typer.Option(
            help="YAML file that maps the topics of a bag or the columns of a table", exists=True
        ),
    ] = None,
    actions: Annotated[
        Literal["auto", "hidden"],
        typer.Option(help="auto: as recorded, hidden where there are poses alone; hidden: all"),
    ] = "auto",
    tolerant: Annotated[
        bool, typer.Option("--tolerant", help="use what damaged bags still hold")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Turn recordings into the table of decisions that learning starts from.

    serd demos BAG --scenario hallway --output decisions.csv

    Beside it are written decisions.grid.yaml, whose cells are the states,
    and decisions.png, the tracks on it. All that is dropped is counted.

    An episode that several bags hold counts once.

    Where people were recorded, decisions.flow.csv and .flow.png show which
    way they walk in each cell. 'serd learn decisions.csv' learns from it.

    A decision ends where the robot enters another cell, where another command
    has been given for 0.3 s, or after the patience of the scenario.

    A place without a scenario gets a grid of cells each of which the robot
    crosses in about a second; --cell-size-m sets others, --area what is
    walkable.

    A bag of another robot needs a mapping, which 'serd bag suggest BAG' writes.
    A bag of poses alone needs none: its actions are hidden, and 'serd learn'
    learns from the states. docs/sources.md lists all keys of a mapping.

    Without marks of episodes a lap ends in the goal area of the scenario, at
    a press of a button, at a stop or where it turns; the way back from the
    goal is left out.

    A table (CSV or Parquet with named columns, text of TUM, KITTI, ETH/UCY
    and PeTrack) has time, x and y, and for several agents their id: each
    is a demonstration, and all of them are the people; actions are hidden.
    Where one of them is named robot, it alone demonstrates. The key experts of
    a mapping names others; experts: people takes the people of a bag.
    """
    require_suffix(output, ".csv")
    require_apart(output, files_beside(output).values(), (scenario, mapping or "", area or ""))
    _require_place(scenario, cell_size_m, area)
    known = load_scenario(scenario) if scenario else None
    area_m = read_area_m(area) if area else None
    kinds = {TableMapping if is_table(bag) else BagMapping for bag in bags}
    if mapping and len(kinds) > 1:
        raise UsageError(f"--mapping must be for bags or for tables, got {mapping} for both")
    chosen = load_yaml_model(mapping, kinds.pop()) if mapping else None
    recordings = read_recordings(
        bags, mapping=chosen, scenario=known, tolerant=tolerant, hidden=actions == "hidden"
    )
    if known is None and cell_size_m is None and area is None:
        _require_no_own(recordings)
    place = _place(recordings, known, cell_size_m, area_m)
    found = demonstrations_of_all(recordings.all, place.grid, place.patience_s, place.wait_s)
    _require_decisions(found)
    flow = flow_from_recordings(recordings.all, recordings.sightings(), place.grid)
    save_demonstrations(output, place, found, flow)
    save_pictures(output, place, found, flow)
    files = {name: path for name, path in files_beside(output).items() if path.exists()}
    if as_json:
        values = {
            "bags": [each.values() for each in found],
            "flow": flow_values(flow, place.flow),
            "cell_size_m": place.grid.cell_size_m,
            "patience_s": place.patience_s,
            "wait_s": place.wait_s,
            "files": {name: str(path.resolve()) for name, path in files.items()},
        }
        print_json(values)
        return
    _print(found, place, flow)
    for name, path in files.items():
        console.print(f"{name}: {path.resolve()}", soft_wrap=True)
    console.print(f"next: serd learn {shlex.quote(str(output))} --report report", soft_wrap=True)


def _place(
    recordings: Recordings,
    scenario: Scenario | None,
    cell_size_m: float | None,
    area_m: shapely.Polygon | None,
) -> Place:
    """Of a scenario, else with a grid that is fitted to where the robot was, or of an area."""
    if scenario:
        return Place(grid_of(scenario), scenario.patience_s, scenario.wait_s, scenario)
    drives = recordings.drives
    size_m = cell_size_m or fitting_cell_size_m(drives)
    grid = fitted_grid(recordings.all, size_m) if area_m is None else grid_of_area(area_m, size_m)
    return Place(grid, fitting_patience_s(drives, size_m), USUAL_WAIT_S)


def _print(found: Sequence[RecordedDemonstrations], place: Place, flow: FlowField | None) -> None:
    console.print(decisions_table(found))
    for line in remarks(found):
        console.print(line, style="yellow", soft_wrap=True)
    console.print(
        f"cells of {place.grid.cell_size_m:g} m; a decision that leads to no other cell ends after"
        f" {place.patience_s:g} s, one to wait after {place.wait_s:g} s",
        soft_wrap=True,
    )
    console.print(flow_in_words(flow, place.flow), soft_wrap=True)


def _require_decisions(found: list[RecordedDemonstrations]) -> None:
    if not any(len(each.decisions) for each in found):
        counts = "; ".join(f"{each.bag}: {each.report}" for each in found)
        outside = any(OFF_GRID in each.report.dropped for each in found)
        fix = "is it this scenario?" if outside else "'serd bag check' lists what they hold"
        raise UsageError(f"there is no decision to learn from in {counts}; {fix}")


def _require_no_own(recordings: Recordings) -> None:
    """UsageError for a recording of ours, which was made in a scenario."""
    for each, mapping in zip(recordings.all, recordings.mappings, strict=True):
        if mapping is None and not is_table(each.bag):
            raise UsageError(
                f"either --scenario or --cell-size-m must be given for {each.bag}, got neither;"
                " give the scenario that it was recorded in"
            )


def _require_place(scenario: str, cell_size_m: float | None, area: Path | None) -> None:
    for name, value in (("--cell-size-m", cell_size_m), ("--area", area)):
        if scenario and value is not None:
            raise UsageError(
                f"either --scenario or {name} must be given, got both; give --scenario where there"
                " is one"
            )
    if area is not None:
        require_area_file(area)
    if cell_size_m is not None and not 0 < cell_size_m < math.inf:
        raise UsageError(f"--cell-size-m must be finite and above 0, got {cell_size_m:g}; try 1")
