"""serd demos BAG --scenario hallway --output decisions.csv

Beside it are written decisions.grid.yaml, whose cells are the states, and decisions.png, the
tracks on it. All that is dropped is counted.

An episode that several bags hold counts once.

Where people were recorded, decisions.flow.csv and .flow.png show which way they walk in each
cell. 'serd learn decisions.csv' learns from it.

A decision ends where the robot enters another cell, where another command has been given for 0.3
s, or after the patience of the scenario.

A place without a scenario gets a grid of cells each of which the robot crosses in about a second;
--cell-size-m sets others, --area what is walkable.

A bag of another robot needs a mapping, which 'serd bag suggest BAG' writes. Of a bag of poses
alone the actions are hidden, and 'serd learn' learns from the states. docs/mapping_keys.yaml
lists all keys of a mapping.

Without marks of episodes a lap ends in the goal area of the scenario, at a stop or where it
turns; the way back from the goal is left out.

A table (CSV with named columns, text of TUM, ETH/UCY and PeTrack) has time, x and y, and for
several agents their id: each is a demonstration, and all of them are the people; actions are
hidden. Where one of them is named robot, it alone demonstrates. The key experts of a mapping
names others.
"""

import shlex
from pathlib import Path
from typing import Annotated, Literal

from serd_cli.options import AsJson, arg, opt, present, require_apart, require_suffix

Bags = Annotated[
    list[Path], arg("bag folders, .mcap, .db3 or .bag files, or tables of trajectories", "BAG")
]
ScenarioName = Annotated[str, opt("built-in scenario or YAML file they were recorded in")]
CellSize = Annotated[
    float | None,
    opt(
        "without a scenario: side of the cells of a grid fitted to where the robot was; by"
        " default as it moves"
    ),
]
Area = Annotated[
    Path | None,
    opt(
        "without a scenario: walkable area in place of where the robot was, .wkt or .geojson in"
        " metres"
    ),
]
Mapping = Annotated[
    Path | None,
    opt("YAML file that maps the topics of a bag or the columns of a table", callback=present),
]
Actions = Annotated[
    Literal["auto", "hidden"],
    opt("auto: as recorded, hidden where there are poses alone; hidden: all"),
]
Tolerant = Annotated[bool, opt("use what damaged bags still hold", "--tolerant")]
Table = Annotated[Path, opt("table to write, ending in .csv")]


def demos(
    bags: Bags,
    scenario: ScenarioName = "",
    cell_size_m: CellSize = None,
    area: Area = None,
    output: Table = Path("decisions.csv"),
    mapping: Mapping = None,
    actions: Actions = "auto",
    tolerant: Tolerant = False,
    as_json: AsJson = False,
) -> None:
    """Parse the options, make the table and print what it holds."""
    require_suffix(output, ".csv")
    from serd_app.demonstrations.decision_table import files_beside
    from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
    from serd_cli.output.demonstrations import print_demonstrated, values_of
    from serd_cli.output.terminal import console, print_json

    require_apart(output, files_beside(output).values(), (scenario, mapping or "", area or ""))
    done = demonstrate(
        bags,
        output,
        PlaceChoice(scenario, cell_size_m, area),
        mapping=mapping,
        tolerant=tolerant,
        hidden=actions == "hidden",
    )
    if as_json:
        print_json(values_of(done))
        return
    print_demonstrated(done)
    if done.too_few:
        console.print(done.too_few, style="yellow", soft_wrap=True)
        return
    console.print(f"next: serd learn {shlex.quote(str(output))} --report report", soft_wrap=True)
