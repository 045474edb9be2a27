"""`serd scenario`: list, draw and film scenarios, and make them from maps."""

from pathlib import Path
from typing import Annotated, Any

import typer

from serd_app.places.settings import PlaceSettings
from serd_cli.commands.film import film
from serd_cli.options import (
    AsJson,
    add_command,
    require_apart,
    require_suffix,
    validated,
    with_settings,
)

group = typer.Typer(add_completion=False, no_args_is_help=True, suggest_commands=True)

ScenarioName = Annotated[str, typer.Argument(help="built-in scenario or YAML file")]
Plan = Annotated[Path | None, typer.Option(help="picture to write, default SCENARIO.png here")]
SchemaFile = Annotated[
    Path | None, typer.Option(help="file to write, e.g. scenario.schema.json; else printed")
]
RosMap = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        help="map.yaml of nav2_map_server, bag with a map topic, or area as .wkt or .geojson",
    ),
]
NewScenario = Annotated[
    Path | None,
    typer.Option(help="scenario to write, ending in .yaml; default MAP-scenario.yaml here"),
]


def list_scenarios(as_json: AsJson = False) -> None:
    """List the built-in scenarios."""
    from serd_cli.output.scenarios import print_list, scenario_values
    from serd_cli.output.terminal import print_json
    from serd_sim.scenario.names import builtin_scenarios
    from serd_sim.scenario.scenario import load_scenario

    scenarios = {name: load_scenario(name) for name in builtin_scenarios()}
    if as_json:
        print_json([scenario_values(name, each) for name, each in scenarios.items()])
    else:
        print_list(scenarios)


def show(scenario: ScenarioName, output: Plan = None, as_json: AsJson = False) -> None:
    """Draw a scenario from above and list its contents.

    serd scenario show hallway

    In metres: walls, cells, start areas, the goal, and the loops that people walk.
    """
    from serd_app.report.pictures import save_plan
    from serd_cli.output.scenarios import print_scenario, scenario_values
    from serd_cli.output.terminal import print_json
    from serd_sim.scenario.scenario import load_scenario

    loaded = load_scenario(scenario)
    picture = output or Path(f"{Path(scenario).stem}.png")
    require_suffix(picture, ".png")
    save_plan(picture, loaded)
    values = scenario_values(scenario, loaded) | {"picture": str(picture.resolve())}
    if as_json:
        print_json(values | {"remark": loaded.patience_remark})
    else:
        print_scenario(values, loaded.patience_remark)


def schema(output: SchemaFile = None, as_json: AsJson = False) -> None:
    """Write the JSON schema of scenario files, for editors that check while you type.

    serd scenario schema --output scenario.schema.json

    With the YAML extension of VS Code, begin your file with
    # yaml-language-server: $schema=scenario.schema.json
    """
    import json

    from serd_bag.files import atomic_write_text
    from serd_cli.output.terminal import print_json
    from serd_sim.scenario.scenario import Scenario

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
    ros_map: RosMap,
    output: NewScenario = None,
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
    """Write a scenario from the map that a robot navigates by; see FROM_MAP."""
    from serd_app.journeys.from_map import scenario_from_map
    from serd_cli.output.scenarios import mapped_values, print_mapped
    from serd_cli.output.terminal import print_json
    from serd_sim.scenario.goal import point_of

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
for name, function, about in (
    ("list", list_scenarios, None),
    ("show", show, None),
    ("film", film, None),
    ("schema", schema, None),
    ("from-map", from_map, FROM_MAP),
):
    add_command(group, name, function, about)
