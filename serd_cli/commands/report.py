"""It shows policy, value, outcomes and forecast, and where demonstrations
decided.

serd report model.yaml --demonstrations decisions.csv

The page needs nothing but itself; its figures and tables lie beside it.
"""

from pathlib import Path
from typing import Annotated

from serd_app.navigation.settings import NavigationSettings, PolicyKind
from serd_cli.options import AsJson, arg, opt, option, present

Model = Annotated[Path, arg("file of a learned model")]
Demonstrations = Annotated[
    Path | None, opt("table of decisions that 'serd demos' wrote", callback=present)
]
Episodes = Annotated[
    Path | None, opt("episodes.csv that 'serd navigate --output' wrote", callback=present)
]
OtherScenario = Annotated[str, opt("scenario or YAML file, in place of the one the model keeps")]
Starts = Annotated[list[str] | None, opt("x,y (m) of a forecast's start, repeat")]


def report(
    model: Model,
    demonstrations: Demonstrations = None,
    episodes: Episodes = None,
    scenario: OtherScenario = "",
    start: Starts = None,
    policy: PolicyKind = option(NavigationSettings, "policy"),
    output: Annotated[Path, opt("folder of the page")] = Path("report"),
    as_json: AsJson = False,
) -> None:
    """Parse the options, write the page and print its summary."""
    from serd_app.journeys.report import ReportSources
    from serd_app.journeys.report import report as write
    from serd_app.report.summary import headline_of
    from serd_app.report.write import summary_rows
    from serd_cli.output.terminal import console, print_json
    from serd_sim.scenario.grid import point_of

    starts_m = tuple(point_of(each, what="start") for each in start or ())
    sources = ReportSources(model, scenario, demonstrations, episodes, starts_m, policy)
    done = write(sources, output)
    if as_json:
        print_json({**done.summary, "report": str(done.page)})
        return
    console.print(headline_of(done.summary), soft_wrap=True)
    for what, value in summary_rows(done.summary):
        console.print(f"{what}: {value}", soft_wrap=True)
    console.print(f"report: {done.page}", soft_wrap=True)
