"""The whole study: run missing stages, then write tables and the figure.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals
OUTPUT/*.csv           tables; OUTPUT/figure_5_9.{csv,png,svg}: the figure with its data
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from pathlib import Path

import pandas as pd

from lab.experiments.study.arrival.stage import arrivals_of_repetition
from lab.experiments.study.fits.fitting import fit_repetition
from lab.experiments.study.hallway.figure import draw, rows
from lab.experiments.study.hallway.tables import Results, all_tables
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
from lab.experiments.study.recordings.experts import EXPERTS
from lab.experiments.study.recordings.reference import reference_tasks
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import Study
from serd_sim.episodes.execution import Execution

#: The settings that the files of each stage depend on.
_DEMONSTRATIONS = REFERENCE_SETTINGS | {
    "discount": True,
    "demonstrations": True,
    "beliefs": {"reward_weights"},
}
_FITS = _DEMONSTRATIONS | {"learning": True, "beliefs": {"reward_weights", "sizes", "repetitions"}}
_ARRIVAL = _FITS | {"beliefs": True, "arrival": True}
#: Name of the files of the figure.
FIGURE = "figure_5_9"
#: Rough seconds of one recorded episode.
_EPISODE_S = 0.8


def run_study(
    settings: StudySettings, output: Path, execution: Execution, on_work: OnWork
) -> dict[str, pd.DataFrame]:
    """Run every stage, then write all tables and the figure; returns the tables by name."""
    results = Results(settings, output / "work")
    make_products(stages_of(Study(settings, output / "work")), execution, on_work)
    tables = all_tables(results)
    shown = rows(results)
    write_results(output, settings, {**tables, FIGURE: shown}, {FIGURE: draw(shown)})
    return tables


def stages_of(study: Study) -> tuple[Stage, ...]:
    """All stages that tables and figures depend on, in their order."""
    settings = study.settings
    parts = settings.repetitions_of(EXPERTS)
    reference, demonstrations = reference_tasks(study), demonstration_tasks(study)
    fits = part_tasks(study, "fits", fit_repetition, parts)
    arrival = part_tasks(study, "arrival", arrivals_of_repetition, parts)
    recorded_s = _EPISODE_S * settings.demonstrations.training * 2 / 3
    measured_s = _EPISODE_S * 4 * settings.arrival.episodes / settings.learning.repetitions
    stages = (
        ("reference recordings", "reference", REFERENCE_SETTINGS, reference, 15 * _EPISODE_S),
        ("demonstrations", "demonstrations", _DEMONSTRATIONS, demonstrations, recorded_s),
        ("learning", "fits", _FITS, fits, 1.0 * len(settings.learning.sizes)),
        ("times of arrival", "arrival", _ARRIVAL, arrival, measured_s),
    )
    return tuple(
        Stage(name, study.folder / folder, described(settings, keys), tasks, task_s)
        for name, folder, keys, tasks, task_s in stages
    )
