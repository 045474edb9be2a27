"""An experiment: a function from frozen settings to tables, figures and texts, written by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from matplotlib.figure import Figure
from pydantic import BaseModel, Field, ValidationError
from pydantic_core import PydanticUndefined

from lab.experiments.running.repetitions import Progress, run_repetitions
from lab.experiments.running.tables import Row, write_table
from serd_app.report.style import save_figure
from serd_bag.files import atomic_write_text, read_text
from serd_core.errors import SerdError
from serd_files.settings import setting, settings_of
from serd_files.yaml_config import StrictModel, read_yaml, sentence_of
from serd_sim.episodes.execution import Execution

#: A setting that is a number of things, and one that is a ladder of such numbers.
Count = Annotated[int, Field(ge=1)]
Sizes = Annotated[tuple[Count, ...], Field(min_length=1)]


class SeededConfig(StrictModel):
    """Settings of an experiment with random numbers."""

    seed: int = setting(0, "of which every random number is derived", ge=0)


def settings_of_file(path: Path) -> dict[str, Any]:
    """Settings of a YAML file of `name: value`; SerdError where it holds anything else."""
    content = read_yaml(read_text(path), str(path))
    if not isinstance(content, dict):
        raise SerdError(f"{path} must hold settings as 'name: value', got {content!r}")
    return content


@dataclass(frozen=True)
class Session:
    """Where and how an experiment runs; progress: called with (done, all)."""

    folder: Path
    execution: Execution
    progress: Progress

    def repeat(
        self, repetition: Callable[[int], list[Row]], n_repetitions: int, config: BaseModel
    ) -> pd.DataFrame:
        """The rows of all repetitions; an interrupted run with the same config is resumed."""
        folder, description = self.folder / "repetitions", repr(config)
        return pd.DataFrame(
            run_repetitions(
                repetition, n_repetitions, folder, description, self.execution, self.progress
            )
        )


@dataclass(frozen=True, eq=False)
class Findings:
    """summary: the table that the command prints; files: what is written, by file name."""

    summary: pd.DataFrame
    files: Mapping[str, pd.DataFrame | Figure | str]


@dataclass(frozen=True)
class Experiment:
    """name; shows: its subject; config: model of its settings; run."""

    name: str
    shows: str
    config: type[BaseModel]
    run: Callable[[Any, Session], Findings]

    def make_config(self, given: Mapping[str, Any]) -> BaseModel:
        """The defaults, changed by values or their text; commas separate the parts of a tuple."""
        values = dict(given)
        for each in settings_of(self.config):
            if each.default is PydanticUndefined and each.name not in given:
                option = f"--{each.name.replace('_', '-')}"
                raise SerdError(f"{option} must be given for {self.name}: {each.description}")
            text = values.get(each.name)
            if each.schema.get("type") == "array" and isinstance(text, str):
                values[each.name] = text.split(",")
        try:
            return self.config.model_validate(values)
        except ValidationError as error:
            raise SerdError(f"{self.name}: {sentence_of(error, self.config)}") from None

    def write(self, config: BaseModel, session: Session) -> pd.DataFrame:
        """Run, and write the files into the folder of the session; returns the summary."""
        findings = self.run(config, session)
        write_files(session.folder, findings.files)
        return findings.summary


def write_files(folder: Path, files: Mapping[str, pd.DataFrame | Figure | str]) -> None:
    """Write tables, figures (.png, .svg) and texts, each whole or not at all."""
    for name, content in files.items():
        file = folder / name
        if isinstance(content, Figure):
            save_figure(file, content)
        elif isinstance(content, pd.DataFrame):
            write_table(file, content)
        else:
            atomic_write_text(file, content)
