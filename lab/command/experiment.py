"""Commands of the experiments: one option per setting of the config."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from lab import RESULTS
from lab.experiments.running.experiment import Experiment, Session, settings_of_file
from lab.experiments.running.provenance import recorded
from lab.experiments.running.tables import print_results
from serd_bag.files import require_folder
from serd_cli.options import EXECUTION, Jobs, with_parameters
from serd_cli.output.terminal import counting_bar, results_kept_in
from serd_files.settings import Setting, settings_of
from serd_sim.episodes.execution import Execution


def command_of(experiment: Experiment) -> Callable[..., None]:
    """A function whose signature Typer turns into the subcommand's options."""

    folder = RESULTS / experiment.name

    def command(
        output: Annotated[Path, typer.Option(help="folder for tables and figures")] = folder,
        jobs: Jobs = EXECUTION.n_jobs,
        config: Annotated[Path | None, typer.Option(help="YAML file of settings")] = None,
        **texts: str | None,
    ) -> None:
        given = settings_of_file(config) if config is not None else {}
        given |= {name: text for name, text in texts.items() if text is not None}
        execution = Execution(jobs)
        words = _words(experiment, config, texts, execution, output)
        made = experiment.make_config(given)
        require_folder(output)
        with recorded(output, words, made):
            table = _run(experiment, made, output, execution)
        print_results(table, experiment.shows)
        print(f"results: {output.resolve()}")

    settings = {
        each.name: (
            Annotated[str | None, typer.Option(*_flags(each.name), help=_help(each))],
            None,
        )
        for each in settings_of(experiment.config)
    }
    command.__doc__ = experiment.shows[0].upper() + experiment.shows[1:] + "."
    return with_parameters(command, settings)


def _words(
    experiment: Experiment,
    config: Path | None,
    texts: Mapping[str, str | None],
    execution: Execution,
    output: Path,
) -> str:
    """The command that repeats the run."""
    words = ["python", "-m", "lab", experiment.name]
    words += ["--config", str(config)] if config is not None else []
    for name, text in texts.items():
        words += [_flags(name)[0], text] if text is not None else []
    words += ["--jobs", str(execution.n_jobs)]
    return shlex.join([*words, "--output", str(output)])


def _run(
    experiment: Experiment, config: BaseModel, output: Path, execution: Execution
) -> pd.DataFrame:
    """Run with a progress bar."""
    with results_kept_in(output), counting_bar(experiment.name) as bar:
        task = bar.add_task("", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        return experiment.write(config, Session(output, execution, show))


def _flags(name: str) -> list[str]:
    """`--n-bins` and, shorter, `--bins`."""
    flags = [f"--{name.replace('_', '-')}"]
    return [*flags, f"--{name[2:].replace('_', '-')}"] if name.startswith("n_") else flags


def _help(setting: Setting) -> str:
    about = f"{setting.description} ({setting.range})" if setting.range else setting.description
    default = setting.default
    if default is PydanticUndefined:
        return f"required: {about}"
    if default is None:
        return about
    text = ",".join(map(str, default)) if isinstance(default, tuple) else str(default)
    return rf"{about} \[default: {text}]"
