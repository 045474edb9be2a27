"""`serd navigate`: let a learned model drive, and hold its predicted arrival against it."""

import math
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from os.path import realpath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from serd_app.navigation.drive import DriveSettings, claim_folder, drive, finished_episodes
from serd_app.navigation.evaluation.comparison import Comparison, compare, predicted_law
from serd_app.navigation.evaluation.prediction_support import reasons_text
from serd_app.navigation.settings import NavigationSettings
from serd_app.places.kept_scenario import scenario_of_model
from serd_bag.files import require_folder
from serd_bag.quantities import counted
from serd_cli.options import AsJson, resolved_scenario, validated, with_settings
from serd_cli.output.terminal import console, counting_bar, print_json, results_kept_in
from serd_cli.processes.stack_run import run_stack, stack_environment
from serd_files.episode_table import EpisodeResult, load_episodes
from serd_files.model_file import load_model
from serd_sim.drivers.strategy import Strategy, load_strategy
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.goal import with_goal
from serd_sim.scenario.grid import grid_of, start_states_of
from serd_sim.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@with_settings(
    DriveSettings,
    patience_decisions="--patience",
    minimum_arrival_probability="--minimum-probability",
)
def navigate(
    model: Annotated[Path, typer.Argument(help="file of a learned model")],
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file, the model's own when not given")
    ] = "",
    ros: Annotated[bool, typer.Option("--ros", help="through ROS nodes, not in process")] = False,
    output: Annotated[
        Path | None, typer.Option(help="folder for tables and arrival.png, else nothing is kept")
    ] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Drive by a learned model; compare predicted with measured times of arrival.

    serd navigate model.yaml --goal 3.5,20.5 --episodes 30

    Rerun an interrupted drive in process with the same --output to resume it.
    """
    settings = validated(
        DriveSettings,
        model=realpath(model),
        scenario=resolved_scenario(
            scenario or scenario_of_model(model, load_model(model).scenario)
        ),
        **options,
    )
    strategy = _strategy_of(settings)
    if output is not None:
        require_folder(output)
        claim_folder(output, settings)
    if not ros:
        rows = _drive_in_process(settings, output)
    else:
        with TemporaryDirectory() if output is None else nullcontext(str(output)) as folder:
            rows = _drive_through_ros(settings, Path(folder))
    found = compare(strategy, settings.start_area, rows)
    if output is not None:
        figure = comparison_figure(strategy, settings, rows)
        from serd_app.report.style import save_figure

        save_figure(output / "arrival.png", figure)
    if as_json:
        print_json({**settings.model_dump(), **asdict(found)})
        return
    console.print(comparison_table(found))
    for line in remarks(found, strategy.scenario):
        console.print(line, soft_wrap=True)
    if output is not None:
        console.print(f"tables and arrival.png: {output.resolve()}", soft_wrap=True)


def _strategy_of(settings: DriveSettings) -> Strategy:
    """The plan; raises the error of any bad option before anything drives."""
    scenario = with_goal(settings.place(), settings.goal)
    start_states_of(scenario, grid_of(scenario), settings.start_area)
    make_planner(settings.planner, scenario)
    return load_strategy(
        settings.model,
        scenario,
        settings.policy,
        transfer=settings.transfer,
        timeout_s=settings.timeout_s,
    )


def _drive_through_ros(settings: DriveSettings, output: Path) -> list[EpisodeResult]:
    """Drive all episodes in lock-step; the strategy writes its tables to the folder."""
    same_names = {*NavigationSettings.model_fields, "start_area", "people"}
    given = {
        **settings.model_dump(include=same_names, exclude_none=True),
        "local_planner.planner": settings.planner,
        "strategy.output": str(output),
    }
    logs = output / "logs"
    with stack_environment(logs) as environment:
        total = settings.episodes
        run_stack("navigate", given, environment, total=total, logs=logs)
    return list(load_episodes(output / "episodes.csv"))


def _drive_in_process(settings: DriveSettings, output: Path | None) -> list[EpisodeResult]:
    n_finished = len(finished_episodes(settings, output))
    bar = counting_bar("{task.description}", "[dim]{task.fields[text]}", bar_width=20)
    with results_kept_in(output), bar:
        task = bar.add_task("navigate", total=settings.episodes, completed=n_finished, text="")

        def show(row: EpisodeResult) -> None:
            bar.update(task, advance=1, text=f"{row.outcome} after {row.duration_s:.1f} s")

        return drive(settings, output, show)


def comparison_figure(
    strategy: Strategy, settings: DriveSettings, episodes: Sequence[EpisodeResult]
) -> "Figure":
    """Predicted and measured share of arrivals over time, with bands."""
    law = predicted_law(strategy, settings.start_area)
    times_s = [row.time_of_arrival_s if row.arrived else math.inf for row in episodes]
    from serd_app.report.figures.arrival import draw_comparison

    return draw_comparison(law, times_s, settings.timeout_s)


def comparison_table(found: Comparison) -> Table:
    """One row per quantity: predicted, measured."""
    table = Table(title="Arrival", title_justify="left")
    table.add_column("", no_wrap=True)
    table.add_column("predicted", justify="right")
    table.add_column("measured", justify="right")
    low, high = found.measured_interval_95
    share = f"{found.n_arrived} of {found.n_episodes} ({low:.0%} to {high:.0%})"
    table.add_row("arrives in time", f"{found.predicted_probability:.1%}", share)
    for name, predicted_s, measured_s in (
        ("half of all by", found.predicted_median_s, found.measured_median_s),
        ("nine in ten by", found.predicted_most_s, found.measured_most_s),
    ):
        table.add_row(name, _seconds(predicted_s), _seconds(measured_s))
    low_s, high_s = map(_seconds, found.predicted_band_s)
    table.add_row("nine in ten between", f"{low_s} and {high_s}", f"{found.covered:.0%} did")
    return table


def remarks(found: Comparison, scenario: Scenario) -> list[str]:
    """Further results and warnings, one line each."""
    endings = ", ".join(f"{count} {ending}" for ending, count in found.outcomes.items())
    lines = [
        f"largest gap between predicted and measured share: {found.gap_text}",
        f"{counted(found.n_episodes, 'episode')}: {endings}; contacts: robot into people "
        f"{found.robot_on_person}, people into robot {found.person_on_robot}, walls "
        f"{found.robot_on_wall}",
    ]
    lines.append(
        f"driven among {found.n_people} people; the model does not keep among how many it was "
        "learned: give --people where they were more or fewer"
    )
    if found.transferred:
        lines.append("the model was learned on another grid")
    if found.no_prediction_because:
        reasons = reasons_text(found.no_prediction_because)
        lines.append(f"what is predicted is not supported, because {reasons}")
    return [*lines, *filter(None, [scenario.patience_remark]), *found.plan_remarks]


def _seconds(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s:.1f} s"
