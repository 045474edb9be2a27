"""The people study: read the recordings, run missing folds, then write tables and the figure.

OUTPUT/work/...        predictions of what does not learn, by recording, and files of the folds
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

from lab.experiments.study.people.cross_validation.fold import run_fold
from lab.experiments.study.people.cross_validation.folds import Fold, folds_of
from lab.experiments.study.people.cross_validation.periods import period_rows
from lab.experiments.study.people.cross_validation.walkers import walker_predictions
from lab.experiments.study.people.figure import people_figure
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
from serd_files.yaml_text import write_yaml
from serd_sim.episodes.execution import Execution

#: The settings that the files of each stage depend on, besides the recordings.
_WALKERS: dict[str, Any] = {"columns": True, "grid": True, "forecast": True}
_FOLDS = _WALKERS | {"crowd": True, "folds": True, "discount": True, "seed": True}


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

    @cached_property
    def predictions(self) -> tuple[Mapping[str, Any], ...]:
        """Of what does not learn, by run."""
        return tuple(load_part(self, "walkers", number) for number in range(len(self.people.runs)))

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
    for number, fold in enumerate(folds):
        fold["arrivals"] += load_part(study, "periods", number)["arrivals"]
    tables = all_tables(folds, study.people.runs, settings)
    write_results(output, named, tables, {"people": people_figure(tables)})
    return tables


def stages_of(study: PeopleStudy) -> tuple[Stage, ...]:
    """All stages in their order; task_s are rough."""
    runs = study.people.runs
    stages = (
        ("walkers", _WALKERS, _walkers, runs, 40.0),
        ("periods", _FOLDS, _periods, study.folds, 2.0),
        ("folds", _FOLDS, _fold, study.folds, 100.0),
    )
    digests = [sha256(Path(each).read_bytes()).hexdigest() for each in study.settings.files]
    names = [run.name for run in runs]
    recorded = write_yaml({"sha256": dict(zip(names, digests, strict=True))})
    return tuple(
        Stage(
            name,
            study.folder / name,
            described(study.settings, keys) + recorded,
            part_tasks(study, name, make, zip(range(len(parts)))),
            task_s,
        )
        for name, keys, make, parts, task_s in stages
    )


def _walkers(study: PeopleStudy, number: int) -> Mapping[str, Any]:
    return walker_predictions(study.people.runs[number], study.settings)


def _periods(study: PeopleStudy, number: int) -> Mapping[str, Any]:
    return {"arrivals": period_rows(study.people, study.folds[number], number)}


def _fold(study: PeopleStudy, number: int) -> Mapping[str, Any]:
    return run_fold(study.people, study.folds[number], number, study.predictions)
