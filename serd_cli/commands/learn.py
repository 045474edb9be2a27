"""`serd learn`: a table of decisions into a model file, without any ROS."""

from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

from report.style import counted
from serd_app.learning.outcome_files import lesson_files, save_lesson
from serd_app.learning.recipe import Lesson
from serd_app.learning.recipe import learn as fit_lesson
from serd_app.learning.settings import LessonSettings
from serd_app.learning.summary import lesson_in_words, lesson_values
from serd_cli.errors import FAILED, UsageError
from serd_cli.fit_words import (
    Certainty,
    certainty_of,
    certainty_values,
    outcomes_table,
    remarks,
    weights_table,
)
from serd_cli.json_output import print_json
from serd_cli.learning_files import FlowSource, LearningFiles, read_learning_files
from serd_cli.overwriting import require_apart
from serd_cli.progress import WorkProgress
from serd_cli.recorded_demonstrations import files_beside
from serd_cli.terminal import console
from serd_core.ascent.ascent import Step
from sim.scenario.goal import point_of
from storage.yaml_config import sentence_of


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(no_args_is_help=True)(learn)


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
    discount: Annotated[float, typer.Option(help="of the reward, below 1")] = 0.99,
    prior_weight: Annotated[
        float, typer.Option(min=0.0, help="of the divergence to the counted outcomes")
    ] = 0.1,
    pseudo_count: Annotated[float, typer.Option(help="added to every counted outcome")] = 1.0,
    starts: Annotated[int, typer.Option(min=1, help="random starts, the best is kept")] = 4,
    minimum_decisions: Annotated[int, typer.Option(min=1, help="refuse to learn from fewer")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="of the random starts")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON instead of a table")] = False,
) -> None:
    """Learn rewards and dynamics from a table of decisions.

    serd learn decisions.csv --output model.yaml

    What 'serd demos' wrote beside the table must still be there. grid.yaml
    and learning.csv are written beside the model.
    """
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"--output must end in .yaml, got {output}; name a .yaml file")
    require_apart(output, lesson_files(output).values(), (*files_beside(table).values(), scenario))
    settings = _settings(
        minimum_decisions=minimum_decisions,
        seed=seed,
        discount=discount,
        prior_weight=prior_weight,
        pseudo_count=pseudo_count,
        starts=starts,
    )
    files = read_learning_files(
        table,
        discount=discount,
        scenario=scenario,
        flow=flow,
        goals_m=tuple(point_of(each) for each in goal or ()),
    )
    _require_left(files, minimum_decisions)
    lesson = _fitted(files, settings)
    save_lesson(output, lesson, files.task)
    decisions, problem = files.demonstrations.decisions, files.task.problem
    certainty = certainty_of(problem, decisions, lesson.fit)
    if as_json:
        print_json(_values(files, lesson, certainty, output))
    else:
        _print(files, lesson, certainty, output)
    if not lesson.fit.converged:
        raise typer.Exit(FAILED)


def _settings(**values: float) -> LessonSettings:
    try:
        return LessonSettings(**values)  # type: ignore[arg-type]
    except ValidationError as error:
        raise UsageError(sentence_of(error, LessonSettings)) from None


def _require_left(files: LearningFiles, minimum_decisions: int) -> None:
    """The learner's own refusal cannot know how many decisions the goal has cost."""
    n_left = len(files.demonstrations.decisions)
    if files.n_after_goal and n_left < minimum_decisions:
        goals = "; ".join(f"{x:g},{y:g}" for x, y in files.goals_m)
        raise UsageError(
            f"at least {minimum_decisions} decisions before the goal are needed to learn, got"
            f" {n_left} and {files.n_after_goal} after it (goal: {goals}); name another --goal"
        )


def _fitted(files: LearningFiles, settings: LessonSettings) -> Lesson:
    """Fit with a line of progress on stderr."""
    bar = WorkProgress(
        SpinnerColumn(),
        TextColumn("learning"),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[said]}"),
    )
    with bar:
        task = bar.add_task("", total=None, said="")

        def tell(start: int, step: Step) -> None:
            said = f"start {start + 1} of {settings.starts}, step {step.number}"
            bar.update(task, said=f"{said}: {step.objective:.4f} per decision")

        return fit_lesson(files.task, files.demonstrations, settings, tell)


def _print(files: LearningFiles, lesson: Lesson, certainty: Certainty, output: Path) -> None:
    decisions = files.demonstrations.decisions
    left_out = f", {files.n_after_goal} after the goal left out" if files.n_after_goal else ""
    place = f"scenario {files.task.scenario}" if files.task.scenario else "fitted grid"
    console.print(
        f"{counted(len(decisions), 'decision')} in {counted(len(decisions.episodes), 'episode')}"
        f"{left_out}; {place}, flow of people: {files.flow_from}, goal:"
        f" {'; '.join(f'{x:g},{y:g}' for x, y in files.goals_m)}",
        soft_wrap=True,
        markup=False,
    )
    console.print(weights_table(lesson.fit, certainty))
    console.print(outcomes_table(files.task.problem, lesson.fit, certainty))
    for line in (*files.remarks(), *remarks(files.task.problem, certainty)):
        console.print(line, style="yellow", soft_wrap=True, markup=False)
    console.print(lesson_in_words(lesson), soft_wrap=True, markup=False)
    console.print(f"model: {output.resolve()}", soft_wrap=True, markup=False)


def _values(
    files: LearningFiles, lesson: Lesson, certainty: Certainty, output: Path
) -> dict[str, Any]:
    return {
        **lesson_values(lesson),
        "outcome_probabilities": lesson.fit.outcome_probabilities.tolist(),
        **certainty_values(certainty),
        "scenario": files.task.scenario,
        "flow": files.flow_from,
        "goals_m": files.goals_m,
        "n_after_goal": files.n_after_goal,
        "n_reaching_goal": files.n_reaching_goal,
        "model": str(output.resolve()),
    }
