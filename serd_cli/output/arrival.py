"""What `serd navigate` shows: progress of its episodes, predicted and measured arrival, remarks."""

from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rich.table import Table

from serd_app.journeys.navigate import Navigated, drive, finished_episodes
from serd_app.navigation.evaluation.comparison import Comparison, reasons_text
from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import DriveSettings, NavigationSettings
from serd_bag.quantities import counted
from serd_cli.output.terminal import console, counting_bar, progress_console, results_kept_in
from serd_cli.processes.stack_run import run_stack, stack_environment
from serd_files.episode_table import EpisodeResult, load_episodes


def print_arrival(done: Navigated, output: Path | None) -> None:
    """The comparison as a table, remarks, and where the files are."""
    if done.missing:
        progress_console.print(done.missing, soft_wrap=True)
    console.print(comparison_table(done.comparison))
    for line in remarks(done.comparison, done.patience_remark):
        console.print(line, soft_wrap=True)
    if output is not None:
        what = "tables" if done.missing else "tables and arrival.png"
        console.print(f"{what}: {output.resolve()}", soft_wrap=True)


def arrival_values(done: Navigated) -> dict[str, Any]:
    """The settings and the comparison by name."""
    return {**done.settings.model_dump(), **asdict(done.comparison)}


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


def remarks(found: Comparison, patience_remark: str) -> list[str]:
    """Further results and warnings, one line each; patience_remark: of the scenario."""
    endings = ", ".join(f"{count} {ending}" for ending, count in found.outcomes.items())
    lines = [
        f"largest gap between predicted and measured share: {found.gap_text}",
        f"{counted(found.n_episodes, 'episode')}: {endings}; contacts: robot into people "
        f"{found.robot_on_person}, people into robot {found.person_on_robot}, walls "
        f"{found.robot_on_wall}",
        f"driven among {found.n_people} people; the model does not keep among how many it was "
        "learned: give --people where they were more or fewer",
    ]
    if found.transferred:
        lines.append("the model was learned on another grid")
    if found.no_prediction_because:
        reasons = reasons_text(found.no_prediction_because)
        lines.append(f"what is predicted is not supported, because {reasons}")
    return [*lines, *filter(None, [patience_remark]), *found.plan_remarks]


def _seconds(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s:.1f} s"


def drive_through_ros(
    settings: DriveSettings, output: Path | None, _: Navigator
) -> list[EpisodeResult]:
    """Drive all episodes in lock-step; the strategy writes its tables to the folder, if any."""
    same_names = {*NavigationSettings.model_fields, "start_area", "people"}
    with TemporaryDirectory() if output is None else nullcontext(str(output)) as folder:
        given = {
            **settings.model_dump(include=same_names, exclude_none=True),
            "strategy.output": folder,
        }
        logs = Path(folder) / "logs"
        with stack_environment(logs) as environment:
            run_stack("navigate", given, environment, total=settings.episodes, logs=logs)
        return list(load_episodes(Path(folder) / "episodes.csv"))


def drive_in_process(
    settings: DriveSettings, output: Path | None, navigator: Navigator
) -> list[EpisodeResult]:
    """Drive the episodes that are not finished yet, in this process."""
    n_finished = len(finished_episodes(settings, output))
    bar = counting_bar("{task.description}", "[dim]{task.fields[text]}", bar_width=20)
    with results_kept_in(output), bar:
        task = bar.add_task("navigate", total=settings.episodes, completed=n_finished, text="")

        def show(row: EpisodeResult) -> None:
            bar.update(task, advance=1, text=f"{row.outcome} after {row.duration_s:.1f} s")

        return drive(settings, output, show, navigator)
