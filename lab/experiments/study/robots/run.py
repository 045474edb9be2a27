"""The study of four robots: run missing stages, then write tables and the figure.

OUTPUT/work/...        files of the stages: what was learned, and drives
OUTPUT/*.csv           tables; OUTPUT/robots.{png,svg}: the figure
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from lab.experiments.study.products import (
    OnWork,
    Stage,
    described,
    make_products,
    part_tasks,
    write_results,
)
from lab.experiments.study.robots.drives import drive_repetition
from lab.experiments.study.robots.figure import robots_figure
from lab.experiments.study.robots.robots import learn_repetition
from lab.experiments.study.robots.settings import RobotsSettings, RobotsStudy
from lab.experiments.study.robots.tables import all_tables
from serd_sim.episodes.execution import Execution

_DEPENDS = dict.fromkeys(("discount", "seed", "demonstrations", "places"), True)


def run_robots(
    settings: RobotsSettings, output: Path, execution: Execution, on_work: OnWork
) -> Mapping[str, pd.DataFrame]:
    """Run every stage, then write all tables and the figure; returns the tables by name."""
    study = RobotsStudy(settings, output / "work")
    stages = []
    for name, make, seconds in (
        ("learning", learn_repetition, 60.0),
        ("drives", drive_repetition, 300.0),
    ):
        tasks = part_tasks(study, name, make, settings.parts)
        folder = study.folder / name
        stages.append(Stage(name, folder, described(settings, _DEPENDS), tasks, seconds))
    make_products(stages, execution, on_work)
    tables = all_tables(study)
    write_results(output, settings, tables, {"robots": robots_figure(tables["drives"])})
    return tables
