"""`serd scenario`: list, draw and describe scenarios."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from serd_cli.commands.scenario_from_map import from_map
from serd_cli.options import AsJson
from serd_cli.output.paths import require_suffix
from serd_cli.output.scenario import save_plan, scenario_values
from serd_cli.output.terminal import console, print_json
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario, builtin_scenarios, load_scenario
from storage.files import atomic_write_text


def register(app: typer.Typer) -> None:
    """Add the subcommands."""
    group = typer.Typer(
        no_args_is_help=True,
        suggest_commands=True,
        help="List and draw scenarios, and write your own.",
    )
    group.command("list")(list_scenarios)
    group.command()(show)
    group.command()(schema)
    group.command(no_args_is_help=True)(from_map)
    app.add_typer(group, name="scenario")


def list_scenarios(as_json: AsJson = False) -> None:
    """List the built-in scenarios."""
    scenarios = {name: load_scenario(name) for name in builtin_scenarios()}
    if as_json:
        print_json([scenario_values(name, each) for name, each in scenarios.items()])
        return
    table = Table(title="Built-in scenarios", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("people", justify="right")
    table.add_column("cells", justify="right")
    table.add_column("description", overflow="fold")
    for name, each in scenarios.items():
        numbers = str(each.pedestrians.count), str(grid_of(each).n_states)
        table.add_row(name, *numbers, escape(each.description))
    console.print(table)


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
    save_plan(loaded, picture)
    values = scenario_values(scenario, loaded) | {"picture": str(picture.resolve())}
    if as_json:
        print_json(values)
        return
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    path = values.pop("picture")
    for name, value in values.items():
        table.add_row(name.replace("_", " "), escape(_text(value)))
    console.print(table)
    print(f"picture: {path}")  # in one piece, however long


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


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
