"""The people study: read the recordings, run missing folds, then write tables and the figure.

OUTPUT/work/...        files of the folds
OUTPUT/*.csv           tables; OUTPUT/people.{png,svg}: the figure
OUTPUT/settings.yaml   the settings that reproduce all of it, with the names of the files
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import pandas as pd

from lab.experiments.study.people.figure import people_figure
from lab.experiments.study.people.fold import Fold, folds_of, run_fold
from lab.experiments.study.people.people import People
from lab.experiments.study.people.settings import PeopleSettings
from lab.experiments.study.people.tables import all_tables
from lab.experiments.study.products import (
    OnWork,
    Stage,
    described,
    load_part,
    make_products,
    part_tasks,
    write_results,
)
from serd_files.yaml_config import write_yaml
from serd_sim.episodes.execution import Execution

#: The settings that the files of each stage depend on, besides the recordings.
_PARTS = (
    "columns",
    "grid",
    "training_people",
    "patience_s",
    "wait_s",
    "folds",
    "forecast",
    "discount",
)
_FOLDS = dict.fromkeys(_PARTS, True)


@dataclass(frozen=True)
class PeopleStudy:
    """The study; all its tasks get it. folder: of its stages."""

    settings: PeopleSettings
    folder: Path

    @property
    def people(self) -> People:
        """The people of the recordings, read once in each process."""
        return _people(self.settings.model_dump_json())

    @cached_property
    def folds(self) -> tuple[Fold, ...]:
        """Who is learned from and who is held out."""
        return folds_of(self.people.runs, self.settings.folds)

    def __getstate__(self) -> dict[str, Any]:
        return {"settings": self.settings, "folder": self.folder}


@lru_cache(maxsize=1)
def _people(settings: str) -> People:
    return People.read(PeopleSettings.model_validate_json(settings))


def run_people(
    settings: PeopleSettings, output: Path, execution: Execution, on_work: OnWork
) -> Mapping[str, pd.DataFrame]:
    """Run what is missing, then write all tables and the figure; returns the tables by name."""
    paths = [Path(each) for each in settings.files]
    absolute = settings.model_copy(update={"files": tuple(str(each.resolve()) for each in paths)})
    study = PeopleStudy(absolute, output / "work")
    make_products(stages_of(study), execution, on_work)
    named = settings.model_copy(update={"files": tuple(each.name for each in paths)})
    folds = [load_part(study, "folds", number) for number in range(len(study.folds))]
    tables = all_tables(folds, study.people.runs, settings)
    write_results(output, named, tables, {"people": people_figure(tables)})
    return tables


def stages_of(study: PeopleStudy) -> tuple[Stage, ...]:
    """The one stage, of the folds; task_s is rough."""
    names = [run.name for run in study.people.runs]
    digests = [sha256(Path(each).read_bytes()).hexdigest() for each in study.settings.files]
    recorded = write_yaml({"sha256": dict(zip(names, digests, strict=True))})
    tasks = part_tasks(study, "folds", _fold, zip(range(len(study.folds))))
    described_by = described(study.settings, _FOLDS) + recorded
    return (Stage("folds", study.folder / "folds", described_by, tasks, 20.0),)


def _fold(study: PeopleStudy, number: int) -> Mapping[str, Any]:
    return run_fold(study.people, study.folds[number], number)
