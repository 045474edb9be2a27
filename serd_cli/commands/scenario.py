"""`serd scenario`: list, draw and film scenarios, and make them from maps."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from serd_app.places.settings import PlaceSettings
from serd_bag.quantities import counted
from serd_cli.errors import UsageError
from serd_cli.options import (
    AsJson,
    add_command,
    arg,
    opt,
    option,
    require_apart,
    require_suffix,
    validated,
    with_settings,
)
from serd_cli.output.terminal import console, counting_bar, facts_table, print_json, table_of
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.episode import EpisodeSettings, WorldSettings
from serd_sim.scenario.grid import grid_of, point_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from serd_app.journeys.from_map import MappedScenario

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)

ScenarioName = Annotated[str, arg("built-in scenario or YAML file")]
MapFile = Annotated[
    Path,
    arg("map.yaml of nav2_map_server, or area as .wkt or .geojson", "MAP"),
]
NewScenario = Annotated[
    Path | None, opt("scenario to write, ending in .yaml; default MAP-scenario.yaml here")
]
Policy = Annotated[str, opt(f"{', '.join(driver_names())} or a learned model's file")]
At = Annotated[float | None, opt("time of a .png (s), the end when not given", "--at", min=0)]


def list_scenarios(as_json: AsJson = False) -> None:
    """List the built-in scenarios."""

    scenarios = {name: load_scenario(name) for name in builtin_scenarios()}
    if as_json:
        print_json([scenario_values(name, each) for name, each in scenarios.items()])
    else:
        print_list(scenarios)


def show(
    scenario: ScenarioName,
    output: Annotated[Path | None, opt("picture to write, default SCENARIO.png here")] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a scenario from above and list its contents.

    serd scenario show hallway

    In metres: walls, cells, start areas, the goal, and the loops that people walk.
    """
    from serd_app.report.maps import save_plan

    loaded = load_scenario(scenario)
    picture = output or Path(f"{Path(scenario).stem}.png")
    require_suffix(picture, ".png")
    save_plan(picture, loaded)
    values = scenario_values(scenario, loaded) | {"picture": str(picture.resolve())}
    if as_json:
        print_json(values | {"remark": loaded.patience_remark})
    else:
        print_scenario(values, loaded.patience_remark)


def film(
    output: Annotated[Path, opt("file to write: .gif or .png")],
    scenario: ScenarioName = "hallway",
    policy: Policy = "expert",
    seed: int = option(EpisodeSettings, "seed", default=1),
    people: int | None = option(WorldSettings, "people"),
    start_area: str = option(WorldSettings, "start_area"),
    speed: Annotated[float, opt("times real time", min=0.1, max=1000)] = 4.0,
    at_s: At = None,
    as_json: AsJson = False,
) -> None:
    """Drive one episode and write it as a movie, or one moment of it as a picture.

    serd scenario film crossing --output episode.gif

    serd scenario film hallway --at 20 --output episode.png

    The same seed and policy give the same drive as in serd batch.
    """
    from serd_app.journeys.film import SUFFIXES
    from serd_app.journeys.film import film as drive_and_draw
    from serd_sim.episodes.batch import EpisodeTask

    require_suffix(output, *SUFFIXES)
    if at_s is not None and output.suffix.lower() != ".png":
        raise UsageError(f"--at must be left out for a movie, got {at_s:g}; --output names a .png")
    task = EpisodeTask(scenario, seed, 0, people, start_area, policy)
    done = drive_and_draw(task, output, speed=speed, at_s=at_s, track=_with_bar)
    picture = str(output.resolve())
    if as_json:
        print_json({"outcome": done.outcome, "duration_s": done.duration_s, "picture": picture})
    else:
        console.print(f"{done.outcome} after {done.duration_s:.1f} s")
        print(f"picture: {picture}")


def _with_bar(ticks: Sequence[int]) -> Iterator[int]:
    with counting_bar("frames") as bar:
        yield from bar.track(ticks)


@with_settings(PlaceSettings)
def from_map(
    ros_map: MapFile,
    output: NewScenario = None,
    goal: Annotated[str, opt("x,y (m) in the goal; default: far from the start")] = "",
    start: Annotated[str, opt("x,y (m) of the start; default: far from the goal")] = "",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Write a scenario from the map that a robot navigates by.

    serd scenario from-map depot.yaml --robot-radius-m 0.18 --max-speed-mps 0.3

    MAP is the YAML file beside the image, as map_saver writes it. The largest
    free area that is connected is walkable (with --start the one around it),
    its borders are the walls. The scenario and a plan of it are written;
    docs/maps.md has all of it.

    A file of polygons in metres (WKT, GeoJSON) is such an area itself, as of a
    place in which people were tracked.
    """
    from serd_app.journeys.from_map import scenario_from_map

    path = output or Path(f"{ros_map.stem}-scenario.yaml")
    require_suffix(path, ".yaml", ".yml")
    require_apart(path, (path, path.with_suffix(".png")), (str(ros_map),))
    made = scenario_from_map(
        ros_map,
        path,
        validated(PlaceSettings, **options),
        goal_m=point_of(goal) if goal else None,
        start_m=point_of(start, what="start") if start else None,
        replace=output is not None,
    )
    if as_json:
        print_json(mapped_values(made))
    else:
        print_mapped(made)


def print_list(scenarios: Mapping[str, Scenario]) -> None:
    """A row per scenario."""
    table = table_of("Built-in scenarios", "name", ("people", "cells"))
    table.add_column("description", overflow="fold")
    for name, each in scenarios.items():
        numbers = str(each.pedestrians.count), str(grid_of(each).n_states)
        table.add_row(name, *numbers, each.description)
    console.print(table)


def print_scenario(values: Mapping[str, Any], remark: str) -> None:
    """A row per value, and the path of the picture below."""
    texts = {
        name.replace("_", " "): ", ".join(map(str, value))
        if isinstance(value, list)
        else str(value)
        for name, value in values.items()
        if name != "picture"
    }
    console.print(facts_table(texts.items()))
    if remark:
        console.print(remark, soft_wrap=True)
    print(f"picture: {values['picture']}")  # in one piece, however long


def print_mapped(made: "MappedScenario") -> None:
    """What is free in the map, and the files."""
    values, map_of = mapped_values(made), ""
    if made.raster is not None:
        rows, columns = made.raster.cells.shape
        degrees = math.degrees(made.raster.yaw_rad)
        turned = f", turned by {degrees:.1f} degrees" if degrees else ""
        map_of = f"map of {columns} x {rows} cells{turned}: "
    console.print(
        f"{map_of}a free area of {values['free_area_m2']:g} m2"
        f" with {counted(values['walls'], 'wall')} and {counted(values['solids'], 'solid')} in it;"
        f" {counted(values['cells'], 'walkable cell')} of {values['cell_size_m']:g} m cover"
        f" {values['cells_area_m2']:g} m2; a patience of {values['patience_s']:g} s",
        soft_wrap=True,
    )
    for name in ("file", "picture"):
        console.print(f"{name}: {values[name]}", soft_wrap=True)


def mapped_values(made: "MappedScenario") -> dict[str, Any]:
    """The scenario and what was found in its map, as plain values."""
    scenario, raster = made.scenario, made.raster
    reached_m2 = float(scenario.cells.walkable.sum()) * scenario.cell_size_m**2
    return scenario_values(str(made.file), scenario) | {
        **({} if raster is None else {"map_size": list(raster.cells.shape[::-1])}),
        "free_area_m2": round(float(made.area.area), 2),
        "cells_area_m2": round(reached_m2, 2),
        "solids": len(scenario.obstacles),
        "walls": len(scenario.wall_segments_m),
        "file": str(made.file.resolve()),
        "picture": str(made.picture.resolve()),
    }


def scenario_values(name: str, scenario: Scenario) -> dict[str, Any]:
    """The main properties as plain values."""
    x_min, y_min, x_max, y_max = scenario.bounds_m
    return {
        "scenario": name,
        "description": scenario.description,
        "size_m": [x_max - x_min, y_max - y_min],
        "cell_size_m": scenario.cell_size_m,
        "cells": grid_of(scenario).n_states,
        "people": scenario.pedestrians.count,
        "loops": [loop.name for loop in scenario.pedestrians.loops],
        "start_areas": list(scenario.start_areas_m),
        "patience_s": scenario.patience_s,
        "wait_s": scenario.wait_s,
        "episode_timeout_s": scenario.episode_timeout_s,
    }


add_command(group, "list", list_scenarios)
for function in (show, film):
    add_command(group, function.__name__, function)
add_command(group, "from-map", from_map)
