"""The whole study: run missing stages, then write tables and figures.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals
OUTPUT/*.csv           tables; OUTPUT/figure_*.{csv,png,svg}: figures with their data
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from lab.experiments.running.tables import read_table, write_table
from lab.experiments.study.arrival.stage import arrivals_of_repetition
from lab.experiments.study.fits.fitting import fit_repetition
from lab.experiments.study.hallway.figures.catalogue import FIGURES, StudyFigure, figure_of
from lab.experiments.study.hallway.tables.catalogue import all_tables
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.products import (
    REFERENCE_SETTINGS,
    SETTINGS_YAML,
    OnWork,
    Stage,
    described,
    make_products,
    part_tasks,
    write_results,
)
from lab.experiments.study.recordings.demonstrations import check_bags, demonstration_tasks
from lab.experiments.study.recordings.experts import EXPERTS
from lab.experiments.study.recordings.reference import reference_tasks
from lab.experiments.study.settings import StudySettings
from lab.experiments.study.study import Study
from serd_app.report.style import save_figure
from serd_core.errors import SerdError
from serd_files.yaml_config import load_yaml_model
from serd_sim.episodes.execution import Execution

#: The settings that the files of each stage depend on.
_DEMONSTRATIONS = REFERENCE_SETTINGS | {
    "discount": True,
    "demonstrations": True,
    "beliefs": {"reward_weights"},
}
_FITS = _DEMONSTRATIONS | {"learning": True, "beliefs": {"reward_weights", "sizes", "repetitions"}}
_ARRIVAL = _FITS | {"beliefs": True, "arrival": True}
#: Rough seconds of one recorded episode.
_EPISODE_S = 0.8


def run_study(
    settings: StudySettings, output: Path, execution: Execution, on_work: OnWork
) -> dict[str, pd.DataFrame]:
    """Run every stage, then write all tables and figures; returns the tables by name."""
    results = Results(settings, output / "work")
    check_bags(results)
    make_products(stages_of(Study(settings, output / "work")), execution, on_work)
    tables = all_tables(results)
    write_results(output, settings, tables, {})
    for figure in FIGURES:
        write_table(output / f"{figure.stem}.csv", figure.rows(results))
        draw_figure(figure, output, results)
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


def redraw(names: Sequence[str], folder: Path) -> list[Path]:
    """Draw figures again from the tables of a finished study; the PNG files."""
    figures = [figure_of(name) for name in names]
    if not (folder / SETTINGS_YAML).exists():
        raise SerdError(
            f"{folder} must hold a finished study, but has no {SETTINGS_YAML}"
            "; run 'python -m lab hallway' first"
        )
    study = Study(load_yaml_model(folder / SETTINGS_YAML, StudySettings), folder / "work")
    return [draw_figure(figure, folder, study) for figure in figures]


def draw_figure(figure: StudyFigure, folder: Path, study: Study) -> Path:
    """Draw the rows of a table as PNG and SVG; the PNG file."""
    drawn = figure.draw(read_table(folder / f"{figure.stem}.csv"), study)
    png = folder / f"{figure.stem}.png"
    save_figure(png, drawn)
    save_figure(png.with_suffix(".svg"), drawn)
    return png
