"""The whole study: run missing stages, then write tables and figures.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals
OUTPUT/*.csv           tables; OUTPUT/figure_*.{csv,png,svg}: figures with their data
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.running.tables import read_table, write_table
from experiments.study.figures.catalogue import FIGURES, StudyFigure, figure_of
from experiments.study.figures.context import FigureContext, context_of
from experiments.study.products import OnWork, make_products
from experiments.study.recordings.bag_sets import check_bags
from experiments.study.settings import StudySettings
from experiments.study.stages import stages_of
from experiments.study.tables.catalogue import all_tables
from experiments.study.tables.results import Results
from report.style import png_bytes, svg_bytes
from serd_core.errors import SerdError
from sim.episodes.execution import Execution
from storage.files import atomic_write_bytes, atomic_write_text
from storage.yaml_config import load_yaml_model, model_yaml

SETTINGS_YAML = "settings.yaml"
#: Results that come with the project.
KEPT = Path(__file__).parents[1] / "results" / "hallway"


def run_study(
    settings: StudySettings, output: Path, execution: Execution, on_work: OnWork
) -> dict[str, pd.DataFrame]:
    """Run every stage, then write all tables and figures; returns the tables by name."""
    work = output / "work"
    check_bags(settings)
    make_products(stages_of(settings, work), execution, on_work)
    results = Results(settings, work)
    atomic_write_text(output / SETTINGS_YAML, model_yaml(settings))
    tables = all_tables(results)
    for name, rows in tables.items():
        write_table(output / f"{name}.csv", rows)
    context = context_of(settings)
    for figure in FIGURES:
        write_table(output / f"{figure.stem}.csv", figure.rows(results))
        draw_figure(figure, output, output, context)
    return tables


def redraw(names: Sequence[str], source: Path, output: Path) -> list[Path]:
    """Draw figures again from the tables of a finished study; the PNG files."""
    figures = [figure_of(name) for name in names]
    if not (source / SETTINGS_YAML).exists():
        raise SerdError(
            f"{source} must hold a finished study, but has no {SETTINGS_YAML}"
            "; run 'serd study hallway' first"
        )
    context = context_of(load_yaml_model(source / SETTINGS_YAML, StudySettings))
    return [draw_figure(figure, source, output, context) for figure in figures]


def draw_figure(figure: StudyFigure, source: Path, output: Path, context: FigureContext) -> Path:
    """Draw the rows of a table as PNG and SVG; the PNG file."""
    drawn = figure.draw(read_table(source / f"{figure.stem}.csv"), context)
    png = output / f"{figure.stem}.png"
    atomic_write_bytes(png, png_bytes(drawn))
    atomic_write_bytes(png.with_suffix(".svg"), svg_bytes(drawn))
    return png
