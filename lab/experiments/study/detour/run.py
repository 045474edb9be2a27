"""The detour study: run missing stages, then write tables and the figure.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals, decoys
OUTPUT/*.csv           tables; OUTPUT/detour.{png,svg}: the figure
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from lab.experiments.study.detour.arrival import arrive_repetition
from lab.experiments.study.detour.decoy import decoy_row
from lab.experiments.study.detour.figure import detour_figure
from lab.experiments.study.detour.fits import EXPERT, learn_repetition
from lab.experiments.study.detour.settings import DetourSettings, DetourStudy
from lab.experiments.study.detour.tables import all_tables
from lab.experiments.study.products import (
    REFERENCE_SETTINGS,
    OnWork,
    Stage,
    described,
    make_products,
    part_tasks,
    write_results,
)
from lab.experiments.study.recordings.demonstrations import demonstration_tasks
from lab.experiments.study.recordings.reference import reference_tasks
from serd_sim.episodes.execution import Execution

ROLES = ("training", "transfer")
#: The settings that the files of each stage depend on.
_DEMONSTRATIONS: dict[str, Any] = REFERENCE_SETTINGS | {
    "discount": True,
    "demonstrations": True,
    "expert_weights": True,
}
_FITS = _DEMONSTRATIONS | {"learning": True, "pseudo_counts": True}
_ARRIVAL = _FITS | {"drives": True}
_DECOY = REFERENCE_SETTINGS | {"discount": True, "expert_weights": True, "decoy": True}


def run_detour(
    settings: DetourSettings, output: Path, execution: Execution, on_work: OnWork
) -> Mapping[str, pd.DataFrame]:
    """Run every stage, then write all tables and the figure; returns the tables by name."""
    study = DetourStudy(settings, output / "work")
    make_products(stages_of(study), execution, on_work)
    tables = all_tables(study)
    write_results(output, settings, tables, {"detour": detour_figure(tables, study)})
    return tables


def stages_of(study: DetourStudy) -> tuple[Stage, ...]:
    """All stages in their order; task_s are rough."""
    settings, experts = study.settings, (EXPERT,)
    parts = settings.repetitions_of(experts)
    stages = (
        ("reference", REFERENCE_SETTINGS, reference_tasks(study), 30.0),
        (
            "demonstrations",
            _DEMONSTRATIONS,
            demonstration_tasks(study, experts, ROLES),
            3.0 * settings.demonstrations.training,
        ),
        ("fits", _FITS, part_tasks(study, "fits", learn_repetition, parts), 15.0),
        ("arrival", _ARRIVAL, part_tasks(study, "arrival", arrive_repetition, parts), 25.0),
        ("decoy", _DECOY, part_tasks(study, "decoy", decoy_row, settings.decoy.parts), 1.0),
    )
    return tuple(
        Stage(name, study.folder / name, described(settings, parts), tasks, seconds)
        for name, parts, tasks, seconds in stages
    )
