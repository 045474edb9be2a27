"""What `serd scenario` prints: the list, one scenario, and what was made of a map."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.table import Table

from serd_bag.quantities import counted
from serd_cli.output.terminal import console
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from serd_app.journeys.from_map import MappedScenario


def print_list(scenarios: Mapping[str, Scenario]) -> None:
    """A row per scenario."""
    table = Table(title="Built-in scenarios", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("people", justify="right")
    table.add_column("cells", justify="right")
    table.add_column("description", overflow="fold")
    for name, each in scenarios.items():
        numbers = str(each.pedestrians.count), str(grid_of(each).n_states)
        table.add_row(name, *numbers, each.description)
    console.print(table)


def print_scenario(values: Mapping[str, Any], remark: str) -> None:
    """A row per value, and the path of the picture below."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in values.items():
        if name != "picture":
            text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
            table.add_row(name.replace("_", " "), text)
    console.print(table)
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
