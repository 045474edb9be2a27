"""`serd learn`: a table of decisions into a model file, without any ROS."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

from serd_app.demonstrations.recorded import files_beside
from serd_app.learning.fit_data import FitProgress
from serd_app.learning.knowledge import certainty_of
from serd_app.learning.learning_files import (
    FlowSource,
    LearningFiles,
    read_learning_files,
)
from serd_app.learning.outcome import FitOutcome, outcome_files, save_outcome
from serd_app.learning.recipe import learn as fit
from serd_app.learning.settings import LearningSettings
from serd_app.places.kept_scenario import require_replaceable
from serd_bag.files import require_file_place, require_folder
from serd_cli.errors import FAILED, UsageError
from serd_cli.options import AsJson, require_apart, require_suffix, validated, with_settings
from serd_cli.output.fit import learned_values, print_learned
from serd_cli.output.terminal import WorkProgress, can_draw, console, print_json
from serd_sim.scenario.goal import point_of


@with_settings(
    LearningSettings,
    prior_weights="--prior-weight",
    reirl_threshold_shares="--reirl-threshold-share",
)
def learn(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", help="table of decisions that 'serd demos' wrote")
    ],
    output: Annotated[Path, typer.Option(help="model file to write, ending in .yaml")] = Path(
        "model.yaml"
    ),
    scenario: Annotated[
        str, typer.Option(help="scenario or YAML file, in place of the one the table names")
    ] = "",
    flow: Annotated[
        FlowSource,
        typer.Option(help="way people walk; auto: the scenario's, else as recorded, else none"),
    ] = "auto",
    goal: Annotated[
        list[str] | None,
        typer.Option(
            help="x,y (m) of a goal cell, repeat; by default the scenario's, else the ends"
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="folder for an HTML page as of 'serd report'")
    ] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Learn rewards and dynamics from a table of decisions.

    serd learn decisions.csv --output model.yaml

    What 'serd demos' wrote beside the table must still be there.
    model.grid.yaml and model.learning.csv are written beside the model; with
    a prior by evidence also model.posterior.csv and model.durations.csv, and
    the information that a demonstration from each cell is expected to add:
    model.next_demonstration.csv and .png.

    Rewards, outcomes and how long moves take: mdce_serd_evidence (the expert
    knows the dynamics; prior by evidence, predictions averaged over the
    posterior), mdce_serd_belief_evidence (evidence also decides whether the expert's
    belief is the truth, near it or independent of it). Rewards and outcomes,
    with durations that are counted: mdce_serd (divergence prior, its weight
    by validation), its variants _coupled and _free (the expert's belief
    differs), pm_serd (Boltzmann policy). Rewards under counted dynamics:
    mdce_irl, mdce_irl_entropy, maxent_irl, policy_matching,
    relative_entropy_irl.
    """
    if table.is_dir() or table.suffix in (".mcap", ".db3", ".bag"):
        raise UsageError(
            f"TABLE must be a table of decisions, got {table}; of a bag 'serd demos' makes one"
        )
    require_suffix(output, ".yaml", ".yml")
    require_apart(
        output,
        outcome_files(output).values(),
        (*files_beside(table).values(), scenario),
    )
    require_file_place(output)
    if report is not None:
        require_folder(report)
    settings = validated(LearningSettings, **options)
    files = read_learning_files(
        table,
        discount=settings.discount,
        scenario=scenario,
        flow=flow,
        goals_m=tuple(point_of(each) for each in goal or ()),
    )
    decisions, problem = files.demonstrations.decisions, files.task.problem
    _require_left(files, settings.minimum_decisions)
    require_replaceable(output, files.task.scenario_yaml)
    outcome = _fitted(files, settings)
    save_outcome(output, outcome, problem.grid)
    if outcome.knowledge is not None and can_draw():
        from serd_app.report.figures.maps import draw_gain
        from serd_app.report.style import save_figure

        figure = draw_gain(None, problem.grid, outcome.knowledge.gain_nats)
        save_figure(outcome_files(output)["gain_map"], figure)
    page = None
    if report is not None:
        from serd_app.report.model_inputs import inputs_of_model
        from serd_app.report.write import write_report

        page = write_report(
            inputs_of_model(output, scenario=scenario, demonstrations=[table]), report
        )
    certainty = certainty_of(outcome.problem, decisions, outcome.fit)
    if as_json:
        reported = {} if page is None else {"report": str(page)}
        print_json(learned_values(files, outcome, certainty, output) | reported)
    else:
        print_learned(files, outcome, certainty, output)
        if page is not None:
            console.print(f"report: {page}", soft_wrap=True)
    if not outcome.fit.converged:
        raise typer.Exit(FAILED)


def _require_left(files: LearningFiles, minimum_decisions: int) -> None:
    """UsageError where the goal leaves too few decisions."""
    n_left = len(files.demonstrations.decisions)
    if files.n_after_goal and n_left < minimum_decisions:
        goals = "; ".join(f"{x:g},{y:g}" for x, y in files.goals_m)
        raise UsageError(
            f"at least {minimum_decisions} decisions before the goal are needed to learn, got"
            f" {n_left} and {files.n_after_goal} after it (goal: {goals}); name another --goal"
        )


def _fitted(files: LearningFiles, settings: LearningSettings) -> FitOutcome:
    """Fit with a line of progress on stderr."""
    bar = WorkProgress(
        SpinnerColumn(),
        TextColumn("learning"),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[step]}"),
    )
    with bar:
        task = bar.add_task("", total=None, step="")

        def show(progress: FitProgress) -> None:
            step = progress.step
            where = f"fit {progress.number} of {progress.total}, step {step.number}"
            bar.update(task, step=f"{where}: {step.objective:.4f} per decision")

        return fit(files.task, files.demonstrations, settings, show)
