"""Products on disk: each task writes one file; files that exist are not written again.

A stage's folder is claimed by the settings its files depend on, so files of other settings are
rejected.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import pandas as pd
from matplotlib.figure import Figure
from pydantic import BaseModel

from lab.experiments.running.experiment import write_files
from lab.experiments.running.repetitions import claim_folder, read_result, write_result
from serd_files.yaml_config import model_yaml, write_yaml
from serd_sim.episodes.execution import Execution

#: Called with the estimated (seconds of work done, seconds of all work, name of the stage).
OnWork = Callable[[float, float, str], None]
SETTINGS_YAML = "settings.yaml"
_WORLD = dict.fromkeys(("scenario", "people", "crowd", "drive", "seed"), True)
#: The settings that the files of reference recordings depend on.
REFERENCE_SETTINGS: dict[str, Any] = _WORLD | {"demonstrations": {"driver"}, "reference": True}


def described(settings: BaseModel, parts: Mapping[str, Any]) -> str:
    """Some parts of the settings as YAML, as the description of a stage."""
    return write_yaml(settings.model_dump(mode="json", include=dict(parts)))


@dataclass(frozen=True)
class Task:
    """make: a picklable function that writes the file it is given, whole or not at all."""

    file: Path
    make: Callable[[Path], None]

    def run(self) -> None:
        """Make the file."""
        self.make(self.file)


@dataclass(frozen=True)
class Stage:
    """Tasks that do not depend on each other, but on all stages before.

    description: the settings the files depend on; task_s: rough seconds of one task, for progress.
    """

    name: str
    folder: Path
    description: str
    tasks: tuple[Task, ...]
    task_s: float

    @property
    def missing(self) -> tuple[Task, ...]:
        """Tasks whose file is not there."""
        return tuple(task for task in self.tasks if not task.file.exists())


def make_products(stages: Sequence[Stage], execution: Execution, on_work: OnWork) -> None:
    """Run missing tasks, stage by stage; after an interruption the rest is run."""
    for stage in stages:
        claim_folder(stage.folder, stage.description)
    total_s = sum(stage.task_s * len(stage.missing) for stage in stages)
    done_s = 0.0
    for stage in stages:
        on_work(done_s, total_s, stage.name)
        for _ in execution.results(Task.run, stage.missing):
            done_s += stage.task_s
            on_work(done_s, total_s, stage.name)


def write_results(
    output: Path,
    settings: BaseModel,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, Figure],
) -> None:
    """Write settings.yaml, tables as .csv and figures as .png and .svg, each by its name."""
    write_files(output, {SETTINGS_YAML: model_yaml(settings)})
    write_files(output, {f"{name}.csv": rows for name, rows in tables.items()})
    for suffix in ("png", "svg"):
        write_files(output, {f"{name}.{suffix}": figure for name, figure in figures.items()})


class StudyFolder(Protocol):
    """A study, which makes the parts of its stages; folder: of the stages."""

    @property
    def folder(self) -> Path: ...


def part_tasks(
    study: StudyFolder,
    stage: str,
    make: Callable[..., Mapping[str, Any]],
    parts: Iterable[tuple[str | int, ...]],
) -> tuple[Task, ...]:
    """One file per part of a stage, with what `make(study, *part)` returns."""
    return tuple(
        Task(_file(study, stage, part), partial(_write, make, study, part)) for part in parts
    )


def load_part(study: StudyFolder, stage: str, *part: str | int) -> dict[str, Any]:
    """What a task of `part_tasks` wrote."""
    return read_result(_file(study, stage, part), dict)


def _file(study: StudyFolder, stage: str, part: tuple[str | int, ...]) -> Path:
    words = (f"{each:02d}" if isinstance(each, int) else each for each in part)
    return study.folder / stage / f"{'_'.join(words)}.json"


def _write(
    make: Callable[..., Mapping[str, Any]],
    study: StudyFolder,
    part: tuple[str | int, ...],
    file: Path,
) -> None:
    write_result(file, make(study, *part))
