"""`serd scenario`: list, draw and describe scenarios, and make them from maps."""

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from serd_app.places.free_area import free_area_m, is_area_file, read_area_m
from serd_app.places.map_scenario import PlaceSettings, map_scenario_yaml
from serd_app.places.ros_map import read_map
from serd_bag.files import atomic_write_text, read_text
from serd_bag.quantities import counted
from serd_cli.errors import UsageError
from serd_cli.options import AsJson, require_apart, require_suffix, validated, with_settings
from serd_cli.output.terminal import console, print_json
from serd_files.yaml_config import yaml_model
from serd_sim.scenario.goal import point_of
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.occupancy import OccupancyRaster
from serd_sim.scenario.scenario import Scenario, load_scenario

group = typer.Typer(
    no_args_is_help=True, suggest_commands=True, help="List and draw scenarios, and write your own."
)


@group.command("list")
def list_scenarios(as_json: AsJson = False) -> None:
    """List the built-in scenarios."""
    scenarios = {name: load_scenario(name) for name in builtin_scenarios()}
    if as_json:
        print_json([_values(name, each) for name, each in scenarios.items()])
        return
    table = Table(title="Built-in scenarios", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("people", justify="right")
    table.add_column("cells", justify="right")
    table.add_column("description", overflow="fold")
    for name, each in scenarios.items():
        numbers = str(each.pedestrians.count), str(grid_of(each).n_states)
        table.add_row(name, *numbers, each.description)
    console.print(table)


@group.command()
def show(
    scenario: Annotated[str, typer.Argument(help="built-in scenario or YAML file")],
    output: Annotated[
        Path | None, typer.Option(help="picture to write, default SCENARIO.png here")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a scenario from above and list its contents: serd scenario show hallway

    In metres: walls, cells, start areas, the goal, and the loops that people walk.
    """
    loaded = load_scenario(scenario)
    picture = output or Path(f"{Path(scenario).stem}.png")
    _save_plan(loaded, picture)
    values = _values(scenario, loaded) | {"picture": str(picture.resolve())}
    if as_json:
        values["remark"] = loaded.patience_remark
        print_json(values)
        return
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    path = values.pop("picture")
    for name, value in values.items():
        table.add_row(name.replace("_", " "), _text(value))
    console.print(table)
    if loaded.patience_remark:
        console.print(loaded.patience_remark, soft_wrap=True)
    print(f"picture: {path}")  # in one piece, however long


@group.command()
def schema(
    output: Annotated[
        Path | None, typer.Option(help="file to write, e.g. scenario.schema.json; else printed")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write the JSON schema of scenario files, for editors that check while you type.

    serd scenario schema --output scenario.schema.json

    With the YAML extension of VS Code, begin your file with
    # yaml-language-server: $schema=scenario.schema.json
    """
    text = json.dumps(Scenario.model_json_schema(), indent=2, ensure_ascii=False) + "\n"
    if output is None:
        print(text, end="")
        return
    require_suffix(output, ".json")
    atomic_write_text(output, text)
    if as_json:
        print_json({"schema": output.resolve()})
    else:
        print(f"schema: {output.resolve()}")


@group.command(no_args_is_help=True)
@with_settings(PlaceSettings)
def from_map(
    ros_map: Annotated[
        Path,
        typer.Argument(
            metavar="MAP",
            help="map.yaml of nav2_map_server, bag with a map topic, or area as .wkt or .geojson",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(help="scenario to write, ending in .yaml; default MAP-scenario.yaml here"),
    ] = None,
    goal: Annotated[
        str, typer.Option(help="x,y (m) in the goal; default: far from the start")
    ] = "",
    start: Annotated[
        str, typer.Option(help="x,y (m) of the start; default: far from the goal")
    ] = "",
    topic: Annotated[str, typer.Option(help="topic of the map in a bag")] = "map",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Write a scenario from the map that a robot navigates by.

    serd scenario from-map depot.yaml --robot-radius-m 0.18 --max-speed-mps 0.3

    MAP is the YAML file beside the image, as map_saver writes it, or a bag
    with a nav_msgs/OccupancyGrid. The largest free area that is connected is
    walkable (with --start the one around it), its borders are the walls. The
    scenario and a plan of it are written; docs/maps.md has all of it.

    A file of polygons in metres (WKT, GeoJSON) is such an area itself, as of a
    place in which people were tracked.
    """
    path = output or Path(f"{ros_map.stem}-scenario.yaml")
    require_suffix(path, ".yaml", ".yml")
    picture = path.with_suffix(".png")
    require_apart(path, (path, picture), (str(ros_map),))
    settings = validated(PlaceSettings, **options)
    start_m = point_of(start, what="start") if start else None
    raster = None if is_area_file(ros_map) else read_map(ros_map, topic)
    area = read_area_m(ros_map, start_m) if raster is None else free_area_m(raster, start_m)
    text = map_scenario_yaml(
        area,
        settings,
        name=ros_map.stem,
        source=f"Place of the {'area' if raster is None else 'map'} {ros_map.name}",
        goal_m=point_of(goal) if goal else None,
        start_m=start_m,
    )
    made = yaml_model(text, Scenario, name=str(path))
    if output is None:
        _require_unedited(path, text)
    atomic_write_text(path, text)
    _save_plan(made, picture)
    reached_m2 = float(made.cells.walkable.sum()) * made.cell_size_m**2
    values = _values(str(path), made) | {
        **({} if raster is None else {"map_size": list(raster.cells.shape[::-1])}),
        "free_area_m2": round(float(area.area), 2),
        "cells_area_m2": round(reached_m2, 2),
        "solids": len(made.obstacles),
        "walls": len(made.wall_segments_m),
        "file": str(path.resolve()),
        "picture": str(picture.resolve()),
    }
    if as_json:
        print_json(values)
        return
    map_of = "" if raster is None else _map_of(raster)
    console.print(f"{map_of}{_sentence(values)}", soft_wrap=True)
    for name in ("file", "picture"):
        console.print(f"{name}: {values[name]}", soft_wrap=True)


def _require_unedited(path: Path, text: str) -> None:
    """UsageError where the file exists and differs from what would be written."""
    if path.exists() and read_text(path) != text:
        raise UsageError(
            f"{path} must not be replaced without --output, got other content than would be"
            f" written; name another file, or give --output {path} to replace it"
        )


def _map_of(raster: OccupancyRaster) -> str:
    rows, columns = raster.cells.shape
    turned = f", turned by {math.degrees(raster.yaw_rad):.1f} degrees" if raster.yaw_rad else ""
    return f"map of {columns} x {rows} cells{turned}: "


def _sentence(values: dict[str, Any]) -> str:
    return (
        f"a free area of {values['free_area_m2']:g} m2"
        f" with {counted(values['walls'], 'wall')} and {counted(values['solids'], 'solid')} in it;"
        f" {counted(values['cells'], 'walkable cell')} of {values['cell_size_m']:g} m cover"
        f" {values['cells_area_m2']:g} m2; a patience of {values['patience_s']:g} s"
    )


def _save_plan(scenario: Scenario, path: Path) -> None:
    """Write the plan as PNG and make its folder; UsageError for another suffix."""
    require_suffix(path, ".png")
    from serd_app.report.figures.hallway import draw_scenario_plan
    from serd_app.report.style import save_figure

    save_figure(path, draw_scenario_plan(scenario))


def _values(name: str, scenario: Scenario) -> dict[str, Any]:
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
        "flow_convention": scenario.flow_convention,
        "start_areas": list(scenario.start_areas_m),
        "patience_s": scenario.patience_s,
        "wait_s": scenario.wait_s,
        "episode_timeout_s": scenario.episode_timeout_s,
    }


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
