"""`serd navigate`: let a learned model drive, and hold its predicted arrival against it."""

from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from report.style import png_bytes
from serd_app.navigation.settings import PolicyKind
from serd_app.navigation.strategy import Strategy, load_strategy
from serd_cli.errors import UsageError
from serd_cli.navigate.comparison import compare, comparison_figure, comparison_table, remarks
from serd_cli.navigate.in_process import drive_in_process
from serd_cli.navigate.settings import NavigateSettings, claim_folder
from serd_cli.navigate.through_ros import drive_through_ros
from serd_cli.options import option, validated
from serd_cli.resume_notice import results_kept_in
from serd_cli.terminal import WorkProgress, console, print_json
from sim.planning.catalogue import make_planner
from sim.scenario.goal import with_goal
from sim.scenario.grid import grid_of, start_states_of
from storage.episode_table import EpisodeResult, load_episodes
from storage.files import atomic_write_bytes
from storage.model_file import load_model


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(no_args_is_help=True)(navigate)


def navigate(
    model: Annotated[Path, typer.Argument(help="file of a learned model")],
    scenario: Annotated[
        str, typer.Option(help="built-in scenario or YAML file, the model's own when not given")
    ] = "",
    goal: str = option(NavigateSettings, "goal"),
    start_area: str = option(NavigateSettings, "start_area"),
    people: int | None = option(NavigateSettings, "people"),
    episodes: int = option(NavigateSettings, "episodes"),
    seed: int = option(NavigateSettings, "seed"),
    timeout_s: float = option(NavigateSettings, "timeout_s"),
    policy: PolicyKind = option(NavigateSettings, "policy"),
    planner: str = option(NavigateSettings, "planner"),
    transfer: bool = option(NavigateSettings, "transfer", "--transfer"),
    lookahead: int = option(NavigateSettings, "lookahead_cells"),
    patience: int = option(NavigateSettings, "patience_periods"),
    minimum_probability: float = option(NavigateSettings, "minimum_arrival_probability"),
    ros: Annotated[bool, typer.Option("--ros", help="through ROS nodes, not in process")] = False,
    output: Annotated[
        Path | None, typer.Option(help="folder for tables and arrival.png, else nothing is kept")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON instead of a table")] = False,
) -> None:
    """Drive by a learned model and compare predicted with measured times of arrival.

    serd navigate model.yaml --goal 3.5,20.5 --episodes 30

    With --output an interrupted drive in process goes on where it stopped.
    """
    settings = validated(
        NavigateSettings,
        model=str(model.resolve()),
        scenario=_scenario_of(scenario, model),
        goal=goal,
        start_area=start_area,
        people=people,
        episodes=episodes,
        seed=seed,
        timeout_s=timeout_s,
        policy=policy,
        planner=planner,
        transfer=transfer,
        lookahead_cells=lookahead,
        patience_periods=patience,
        minimum_arrival_probability=minimum_probability,
    )
    strategy = _strategy_of(settings)
    if output is not None:
        claim_folder(output, settings)
    rows = _drive(settings, output, ros=ros)
    found = compare(strategy, settings, rows)
    if output is not None:
        figure = comparison_figure(strategy, settings, rows)
        atomic_write_bytes(output / "arrival.png", png_bytes(figure))
    if as_json:
        print_json({**settings.model_dump(), **found.values()})
        return
    console.print(comparison_table(found))
    for line in remarks(found, settings):
        console.print(line, soft_wrap=True, markup=False)
    if output is not None:
        console.print(f"tables and arrival.png: {output.resolve()}", soft_wrap=True, markup=False)


def _scenario_of(given: str, model: Path) -> str:
    name = given or load_model(model).scenario
    if not name:
        raise UsageError(
            f"--scenario must be given, {model} was learned on a fitted grid; with --transfer it"
            " drives where cells and decision periods are of the same size"
        )
    return str(Path(name).resolve()) if Path(name).is_file() else name


def _strategy_of(settings: NavigateSettings) -> Strategy:
    """The plan; every fault of what was typed is found here, before anything drives."""
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


def _drive(settings: NavigateSettings, output: Path | None, *, ros: bool) -> list[EpisodeResult]:
    if not ros:
        return _drive_here(settings, output)
    with TemporaryDirectory() if output is None else nullcontext(str(output)) as folder:
        return drive_through_ros(settings, Path(folder))


def _drive_here(settings: NavigateSettings, output: Path | None) -> list[EpisodeResult]:
    table = output / "episodes.csv" if output is not None else None
    done = load_episodes(table)[: settings.episodes] if table and table.is_file() else ()
    bar = WorkProgress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("[dim]{task.fields[said]}"),
    )
    with results_kept_in(table), bar:
        task = bar.add_task("navigate", total=settings.episodes, completed=len(done), said="")

        def tell(row: EpisodeResult) -> None:
            said = f"{row.outcome} after {row.duration_s:.1f} s"
            bar.update(task, advance=1, said=said)

        return drive_in_process(settings, output, done, tell)
