"""`serd experiment NAME`: one subcommand per experiment, one option per setting of its config."""

import inspect
import shlex
from collections.abc import Callable, Mapping
from dataclasses import Field
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from experiments.catalogue import EXPERIMENTS
from experiments.running.provenance import recorded
from experiments.running.settings import (
    Experiment,
    file_settings,
    is_required,
    make_config,
    settings_of,
)
from serd_cli.options import Address, Backend, Jobs
from serd_cli.output_paths import require_folder
from serd_cli.resume_notice import remark_other_code, results_kept_in
from serd_cli.terminal import WorkProgress, console
from sim.episodes.execution import Execution

_OWN = {
    "output": Annotated[Path, typer.Option(help="folder for tables and figures")],
    "jobs": Jobs,
    "backend": Backend,
    "address": Address,
    "config": Annotated[Path | None, typer.Option(help="YAML file of settings")],
}

#: Numbers below this are written with an exponent: four decimals would lose their digits.
SMALL = 1e-3


def register(app: typer.Typer) -> None:
    """Add one subcommand per experiment."""
    group = typer.Typer(no_args_is_help=True, help="Run an experiment of the thesis.")
    group.callback()(lambda: None)
    for experiment in EXPERIMENTS:
        group.command(experiment.name)(command_of(experiment))
    app.add_typer(group, name="experiment")


def command_of(experiment: Experiment) -> Callable[..., None]:
    """A function whose signature Typer turns into the subcommand's options."""
    settings = settings_of(experiment)

    def command(
        output: Path,
        jobs: int,
        backend: str,
        address: str,
        config: Path | None,
        **texts: str | None,
    ) -> None:
        given = file_settings(experiment, config) if config is not None else {}
        given |= {name: text for name, text in texts.items() if text is not None}
        execution = Execution(jobs, backend, address)
        words = _words(experiment, config, texts, execution, output)
        made = make_config(experiment, given)
        require_folder(output)
        remark_other_code(output)
        with recorded(output, words, made):
            table = _run(experiment, made, output, execution)
        _show(experiment, table)
        print(f"results: {output.resolve()}")

    own_defaults: dict[str, Any] = {
        "output": Path("experiment_output") / experiment.name,
        "jobs": -1,
        "backend": "loky",
        "address": "",
    }
    annotations: dict[str, Any] = {**_OWN}
    for name, (field, _) in settings.items():
        annotations[name] = Annotated[str | None, typer.Option(*_flags(name), help=_help(field))]
    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=own_defaults.get(name),
                annotation=kind,
            )
            for name, kind in annotations.items()
        ]
    )
    command.__annotations__ = annotations
    command.__doc__ = experiment.shows[0].upper() + experiment.shows[1:] + "."
    return command


def _words(
    experiment: Experiment,
    config: Path | None,
    texts: Mapping[str, str | None],
    execution: Execution,
    output: Path,
) -> str:
    """The command line that says the same."""
    words = ["serd", "experiment", experiment.name]
    words += ["--config", str(config)] if config is not None else []
    for name, text in texts.items():
        words += [_flags(name)[0], text] if text is not None else []
    words += ["--jobs", str(execution.n_jobs), "--backend", execution.backend]
    words += ["--address", execution.address] if execution.address else []
    return shlex.join([*words, "--output", str(output)])


def _run(experiment: Experiment, config: Any, output: Path, execution: Execution) -> pd.DataFrame:
    """Run with a progress bar."""
    bar = WorkProgress(
        TextColumn(experiment.name),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with results_kept_in(output), bar:
        task = bar.add_task("", total=None)
        return experiment.run(
            config,
            output,
            execution,
            lambda done, total: bar.update(task, completed=done, total=total),
        )


def _show(experiment: Experiment, rows: pd.DataFrame) -> None:
    table = Table(*rows.columns, title=experiment.shows, title_justify="left")
    for row in rows.itertuples(index=False):
        table.add_row(*map(_text, row))
    console.print(table)


def _text(value: Any) -> str:
    if pd.isna(value):
        return ""
    if not isinstance(value, float):
        return str(value)
    # Likelihoods next to one differ from zero in late digits only.
    return f"{value:.2e}" if 0.0 < abs(value) < SMALL else f"{value + 0.0:.4f}"


def _flags(name: str) -> list[str]:
    """`--n-bins` and, shorter, `--bins`."""
    flags = [f"--{name.replace('_', '-')}"]
    return [*flags, f"--{name[2:].replace('_', '-')}"] if name.startswith("n_") else flags


def _help(field: Field[Any]) -> str:
    about = str(field.metadata["about"])
    if is_required(field):
        return f"required: {about}"
    default = field.default
    if default is None:
        return about
    text = ",".join(map(str, default)) if isinstance(default, tuple) else str(default)
    return rf"{about} \[default: {text}]"
