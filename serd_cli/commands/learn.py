"""serd learn decisions.csv --output model.yaml

What 'serd demos' wrote beside the table must still be there.

Beside the model are written model.grid.yaml and model.learning.csv; with a prior by evidence also
model.posterior.csv, model.weights.csv, model.durations.csv, and model.next_demonstration.csv and
.png: the information that a demonstration from each cell is expected to add.

mdce_serd_evidence learns rewards, outcomes and how long moves take (the expert knows the
dynamics; prior by evidence, predictions averaged over the posterior). mdce_serd learns rewards
and outcomes, and counts durations (divergence prior, its weight by validation); in its variants
_coupled and _free the expert's belief differs. mdce_irl learns rewards under counted dynamics.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from serd_app.learning.settings import FlowSource, LearningSettings
from serd_cli.errors import FAILED, UsageError
from serd_cli.options import (
    AsJson,
    arg,
    opt,
    require_apart,
    require_suffix,
    validated,
    with_settings,
)

Table = Annotated[Path, arg("table of decisions that 'serd demos' wrote", "TABLE")]
Model = Annotated[Path, opt("model file to write, ending in .yaml")]
OtherScenario = Annotated[str, opt("scenario or YAML file, in place of the one the table names")]
Flow = Annotated[
    FlowSource, opt("way people walk; auto: the scenario's, else as recorded, else none")
]
Goals = Annotated[
    list[str] | None,
    opt("x,y (m) of a goal cell, repeat; by default the scenario's, else the ends"),
]
Features = Annotated[
    Path | None, opt("YAML file of own features: a polygon, a point or a raster each")
]
Page = Annotated[Path | None, opt("folder for an HTML page as of 'serd report'")]


@with_settings(
    LearningSettings,
    prior_weights="--prior-weight",
    reirl_threshold_shares="--reirl-threshold-share",
)
def learn(
    table: Table,
    output: Model = Path("model.yaml"),
    scenario: OtherScenario = "",
    flow: Flow = "auto",
    goal: Goals = None,
    features: Features = None,
    report: Page = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Parse the options, learn and print what was learned."""
    if table.is_dir() or table.suffix in (".mcap", ".db3", ".bag"):
        fix = "of a bag 'serd demos' makes one"
        raise UsageError(f"TABLE must be a table of decisions, got {table}; {fix}")
    require_suffix(output, ".yaml", ".yml")
    from serd_app.demonstrations.decision_table import files_beside
    from serd_app.journeys.learn import learn_from_table
    from serd_app.learning.outcome import outcome_files
    from serd_cli.output.fit import fit_progress, learned_values, print_learned
    from serd_cli.output.terminal import print_json
    from serd_sim.scenario.grid import point_of

    read: list[str | Path] = [*files_beside(table).values(), scenario]
    require_apart(output, outcome_files(output).values(), read)
    with fit_progress() as show:
        learned = learn_from_table(
            table,
            output,
            validated(LearningSettings, **options),
            scenario=scenario,
            flow=flow,
            goals_m=tuple(point_of(each) for each in goal or ()),
            features=features,
            report=report,
            on_progress=show,
        )
    print_json(learned_values(learned)) if as_json else print_learned(learned)
    if not learned.outcome.fit.converged:
        raise typer.Exit(FAILED)
