"""`serd scenario`: list, draw and film scenarios, and make them from maps."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from serd_app.places.settings import PlaceSettings
from serd_bag.files import atomic_write_text
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
from serd_cli.output.scenarios import (
    mapped_values,
    print_list,
    print_mapped,
    print_scenario,
    scenario_values,
)
from serd_cli.output.terminal import console, counting_bar, print_json
from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.drivers.catalogue import driver_names
from serd_sim.episodes.episode import EpisodeSettings, WorldSettings
from serd_sim.scenario.grid import point_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import Scenario, load_scenario

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)

ScenarioName = Annotated[str, arg("built-in scenario or YAML file")]
MapFile = Annotated[
    Path,
    arg("map.yaml of nav2_map_server, bag with a map topic, or area as .wkt or .geojson", "MAP"),
]
NewScenario = Annotated[
    Path | None, opt("scenario to write, ending in .yaml; default MAP-scenario.yaml here")
]
Policy = Annotated[str, opt(f"{', '.join(driver_names())} or a learned model's file")]
PeopleFrom = Annotated[str, opt("given: people as they are; scan: from the lidar alone")]
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
    from serd_app.report.pictures import save_plan

    loaded = load_scenario(scenario)
    picture = output or Path(f"{Path(scenario).stem}.png")
    require_suffix(picture, ".png")
    save_plan(picture, loaded)
    values = scenario_values(scenario, loaded) | {"picture": str(picture.resolve())}
    if as_json:
        print_json(values | {"remark": loaded.patience_remark})
    else:
        print_scenario(values, loaded.patience_remark)


class MovieSettings(StrictModel):
    """How fast an episode is shown."""

    speed: float = setting(4.0, "times real time", gt=0, le=1000)


def film(
    output: Annotated[Path, opt("file to write: .gif or .png")],
    scenario: ScenarioName = "hallway",
    policy: Policy = "expert",
    people_from: PeopleFrom = "given",
    seed: int = option(EpisodeSettings, "seed", default=1),
    episode: Annotated[int, opt("number of the episode", min=0)] = 0,
    people: int | None = option(WorldSettings, "people"),
    start_area: str = option(WorldSettings, "start_area"),
    speed: float = option(MovieSettings, "speed"),
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
    validated(MovieSettings, speed=speed)
    if at_s is not None and output.suffix.lower() != ".png":
        raise UsageError(f"--at must be left out for a movie, got {at_s:g}; --output names a .png")
    task = EpisodeTask(scenario, seed, episode, people, start_area, policy, people_from)
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


def schema(
    output: Annotated[
        Path | None, opt("file to write, e.g. scenario.schema.json; else printed")
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


@with_settings(PlaceSettings)
def from_map(
    ros_map: MapFile,
    output: NewScenario = None,
    goal: Annotated[str, opt("x,y (m) in the goal; default: far from the start")] = "",
    start: Annotated[str, opt("x,y (m) of the start; default: far from the goal")] = "",
    topic: Annotated[str, opt("topic of the map in a bag")] = "map",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Parse the options, write the scenario and print what was found in the map."""
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
        topic=topic,
        replace=output is not None,
    )
    if as_json:
        print_json(mapped_values(made))
    else:
        print_mapped(made)


FROM_MAP = """Write a scenario from the map that a robot navigates by.

serd scenario from-map depot.yaml --robot-radius-m 0.18 --max-speed-mps 0.3

MAP is the YAML file beside the image, as map_saver writes it, or a bag
with a nav_msgs/OccupancyGrid. The largest free area that is connected is
walkable (with --start the one around it), its borders are the walls. The
scenario and a plan of it are written; docs/maps.md has all of it.

A file of polygons in metres (WKT, GeoJSON) is such an area itself, as of a
place in which people were tracked.
"""
add_command(group, "list", list_scenarios)
for function in (show, film, schema):
    add_command(group, function.__name__, function)
add_command(group, "from-map", from_map, FROM_MAP)
