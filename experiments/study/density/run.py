"""The density study: run missing stages, then write the tables.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals
OUTPUT/*.csv           tables
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from experiments.running.tables import write_table
from experiments.study.density.settings import DensitySettings, DensityStudy
from experiments.study.density.stages import stages_of
from experiments.study.density.tables import all_tables
from experiments.study.products import OnWork, make_products
from experiments.study.run import SETTINGS_YAML
from sim.episodes.execution import Execution
from storage.files import atomic_write_text
from storage.yaml_config import model_yaml


def run_density(
    settings: DensitySettings, output: Path, execution: Execution, on_work: OnWork
) -> Mapping[str, pd.DataFrame]:
    """Run every stage, then write all tables; returns them by name."""
    study = DensityStudy(settings, output / "work")
    make_products(stages_of(study), execution, on_work)
    atomic_write_text(output / SETTINGS_YAML, model_yaml(settings))
    tables = all_tables(study)
    for name, rows in tables.items():
        write_table(output / f"{name}.csv", rows)
    return tables
