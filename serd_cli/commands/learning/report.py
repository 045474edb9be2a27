"""`serd report`: the HTML page of any learned model."""

from pathlib import Path
from typing import Annotated

import typer

from serd_app.drives.mapped.mapping import BagMapping, TableMapping
from serd_app.drives.table_drives import is_table
from serd_app.navigation.settings import NavigationSettings, PolicyKind
from serd_bag.files import require_folder
from serd_cli.options import AsJson, option
from serd_cli.output.terminal import console, print_json
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.goal import point_of


def report(
    model: Annotated[Path, typer.Argument(help="file of a learned model")],
    demonstrations: Annotated[
        list[Path] | None,
        typer.Option(
            help="table of decisions, or bag or table of trajectories to score, repeat", exists=True
        ),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="YAML file as for 'serd demos', not for decisions", exists=True),
    ] = None,
    episodes: Annotated[
        Path | None,
        typer.Option(help="episodes.csv that 'serd navigate --output' wrote", exists=True),
    ] = None,
    scenario: Annotated[
        str, typer.Option(help="scenario or YAML file, in place of the one the model keeps")
    ] = "",
    start: Annotated[
        list[str] | None, typer.Option(help="x,y (m) of a forecast's start, repeat")
    ] = None,
    policy: PolicyKind = option(NavigationSettings, "policy"),
    output: Annotated[Path, typer.Option(help="folder of the page")] = Path("report"),
    as_json: AsJson = False,
) -> None:
    """Write the HTML page of a learned model.

    It shows policy, value, flow, outcomes and forecast, and how usual
    demonstrations are for the model (compared.csv has a row for each).

    serd report model.yaml --demonstrations decisions.csv

    The page needs nothing but itself; its figures and tables lie beside it.
    """
    require_folder(output)
    chosen = None
    if mapping is not None and demonstrations:
        kind = TableMapping if all(map(is_table, demonstrations)) else BagMapping
        chosen = load_yaml_model(mapping, kind)
    from serd_app.report.model_inputs import inputs_of_model
    from serd_app.report.page import summary_rows
    from serd_app.report.summary import headline_of, summary_of
    from serd_app.report.write import write_report

    inputs = inputs_of_model(
        model,
        scenario=scenario,
        demonstrations=demonstrations or (),
        mapping=chosen,
        episodes=episodes,
        starts_m=tuple(point_of(each, what="start") for each in start or ()),
        kind=policy,
    )
    page = write_report(inputs, output)
    summary = summary_of(inputs)
    if as_json:
        print_json({**summary.as_json(), "report": str(page)})
        return
    console.print(headline_of(summary), soft_wrap=True)
    for what, value in summary_rows(summary):
        console.print(f"{what}: {value}", soft_wrap=True)
    console.print(f"report: {page}", soft_wrap=True)
