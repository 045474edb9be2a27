"""`serd study`: the hallway study (chapter 5) and the detour study, resumable."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import pandas as pd
import typer
from pydantic import BaseModel
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from experiments.running.provenance import recorded
from experiments.running.tables import plain_rows
from experiments.study.detour.run import run_detour
from experiments.study.detour.settings import detour_settings
from experiments.study.detour.tables import headline as detour_headline
from experiments.study.figures.catalogue import FIGURES
from experiments.study.products import OnWork
from experiments.study.run import KEPT, SETTINGS_YAML, redraw, run_study
from experiments.study.settings import study_settings
from experiments.study.tables.catalogue import headline
from serd_cli.errors import UsageError
from serd_cli.options import Address, AsJson, Backend, Jobs
from serd_cli.output.paths import require_folder
from serd_cli.output.resume_notice import remark_other_code, results_kept_in
from serd_cli.output.terminal import TimeLeftColumn, WorkProgress, console, print_json
from sim.episodes.execution import Execution

_FIGURES = ", ".join(figure.name for figure in FIGURES)
Quick = Annotated[bool, typer.Option("--quick", help="small numbers that still run every stage")]
Settings = TypeVar("Settings", bound=BaseModel)
Tables = Mapping[str, pd.DataFrame]


def register(app: typer.Typer) -> None:
    """Add the group of studies."""
    group = typer.Typer(no_args_is_help=True, help="Run a study from recordings to figures.")
    group.callback()(lambda: None)
    group.command()(hallway)
    group.command()(detour)
    app.add_typer(group, name="study")


def hallway(
    output: Annotated[
        Path | None,
        typer.Option(help="folder of the study; default study_output/hallway (or hallway_quick)"),
    ] = None,
    quick: Quick = False,
    config: Annotated[
        Path | None, typer.Option(help="YAML file with any part of hallway_study.yaml")
    ] = None,
    bags: Annotated[
        list[Path] | None,
        typer.Option(help="recorded demonstrations in place of the scripted ones; repeat"),
    ] = None,
    figure: Annotated[
        list[str] | None,
        typer.Option(help=f"only draw again from kept tables: {_FIGURES}; repeat"),
    ] = None,
    jobs: Jobs = -1,
    backend: Backend = "loky",
    address: Address = "",
    as_json: AsJson = False,
) -> None:
    """Navigation in a populated hallway: who learns what, and what arrives when (chapter 5).

    serd study hallway --quick

    Finished parts are not repeated: rerun an interrupted command to resume it.
    """
    folder = _folder("hallway", output, quick=quick)
    if figure:
        pictures = [str(picture.resolve()) for picture in _redraw(figure, folder)]
        if as_json:
            print_json({"pictures": pictures})
        else:
            print("\n".join(pictures))
        return
    settings = study_settings(quick=quick, config=config, bags=bags or ())
    words = _words("hallway", folder, quick=quick, config=config, bags=bags or ())
    tables = _run(run_study, settings, folder, Execution(jobs, backend, address), words)
    title = f"Learned from {settings.learning.sizes[-1]} demonstrations"
    _show(tables, _table(headline(tables), title), folder, as_json=as_json)


def detour(
    output: Annotated[
        Path | None,
        typer.Option(help="folder of the study; default study_output/detour (or detour_quick)"),
    ] = None,
    quick: Quick = False,
    config: Annotated[
        Path | None, typer.Option(help="YAML file with any part of detour_study.yaml")
    ] = None,
    jobs: Jobs = -1,
    backend: Backend = "loky",
    address: Address = "",
    as_json: AsJson = False,
) -> None:
    """A ring corridor where the short way leads against the flow, which demonstrations avoid.

    serd study detour --quick

    Finished parts are not repeated: rerun an interrupted command to resume it.
    """
    folder = _folder("detour", output, quick=quick)
    settings = detour_settings(quick=quick, config=config)
    words = _words("detour", folder, quick=quick, config=config)
    tables = _run(run_detour, settings, folder, Execution(jobs, backend, address), words)
    table = _table(detour_headline(tables), "Transfer task against the flow, reward without norm")
    _show(tables, table, folder, as_json=as_json)


def _folder(study: str, output: Path | None, *, quick: bool) -> Path:
    folder = output or Path("study_output") / (f"{study}_quick" if quick else study)
    require_folder(folder)
    return folder


def _show(tables: Tables, table: Table, folder: Path, *, as_json: bool) -> None:
    if as_json:
        print_json({name: plain_rows(rows) for name, rows in tables.items()})
        return
    console.print(table)
    print(f"results: {folder.resolve()}")


def _run(
    study: Callable[[Settings, Path, Execution, OnWork], Tables],
    settings: Settings,
    folder: Path,
    execution: Execution,
    words: str,
) -> Tables:
    """Run what is missing of a study, with its progress; words: the command that is recorded."""
    remark_other_code(folder)
    bar = WorkProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TimeLeftColumn(execution.n_processes),
    )
    with recorded(folder, words, settings), results_kept_in(folder), bar:
        task = bar.add_task("", total=None)
        return study(
            settings,
            folder,
            execution,
            lambda done, total, stage: bar.update(
                task, completed=done, total=total or 1.0, description=stage
            ),
        )


def _words(
    study: str, folder: Path, *, quick: bool, config: Path | None, bags: Sequence[Path] = ()
) -> str:
    """The command that makes the same results."""
    words = [f"serd study {study}", *(["--quick"] if quick else [])]
    words += [f"--config {config}"] if config is not None else []
    return " ".join([*words, *(f"--bags {bag}" for bag in bags), f"--output {folder}"])


def _redraw(names: list[str], folder: Path) -> list[Path]:
    source = folder if (folder / SETTINGS_YAML).exists() else KEPT
    if not (source / SETTINGS_YAML).exists():
        raise UsageError(
            f"{folder} must hold the tables of a study; run it first, without --figure"
        )
    return redraw(names, source, folder)


def _table(rows: pd.DataFrame, title: str) -> Table:
    table = Table(title=title, title_justify="left")
    for column in rows:
        justify: Literal["left", "right"] = "left" if column == "method" else "right"
        table.add_column(column.replace("_", " "), justify=justify, overflow="fold")
    for row in rows.itertuples(index=False):
        table.add_row(*map(_text, row))
    return table


def _text(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)
