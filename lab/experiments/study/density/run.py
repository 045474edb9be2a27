"""The density study: run missing stages, then write the tables.

OUTPUT/work/...        files of the stages: recordings, fits, arrivals
OUTPUT/*.csv           tables
OUTPUT/settings.yaml   the settings that reproduce all of it
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from lab.experiments.study.density.settings import DensitySettings, DensityStudy
from lab.experiments.study.density.stages import stages_of
from lab.experiments.study.density.tables import all_tables
from lab.experiments.study.products import OnWork, make_products, write_results
from sim.episodes.execution import Execution


def run_density(
    settings: DensitySettings, output: Path, execution: Execution, on_work: OnWork
) -> Mapping[str, pd.DataFrame]:
    """Run every stage, then write all tables; returns them by name."""
    study = DensityStudy(settings, output / "work")
    make_products(stages_of(study), execution, on_work)
    tables = all_tables(study)
    write_results(output, settings, tables, {})
    return tables
