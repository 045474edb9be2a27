"""Settings of the people study: people_study.yaml, with what a file or --quick changes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import Field

from lab.experiments.running.statistics import StatisticsSettings
from lab.experiments.study.settings import merged_settings
from serd_files.trajectories.columns import TableColumns
from serd_files.yaml_config import StrictModel

YAML = Path(__file__).parent / "people_study.yaml"


class GridSettings(StrictModel):
    """How ways become moves between cells; observed_cells: before the arrival is predicted."""

    cell_size_m: float = Field(gt=0)
    observed_cells: int = Field(ge=1)


class FoldSettings(StrictModel):
    """number: of folds, of runs where there are at least runs files, else of time blocks.

    gap_s: between the people of a test block and those learned from.
    """

    number: int = Field(ge=2)
    runs: int = Field(ge=2)
    gap_s: float = Field(ge=0)


class ForecastSettings(StrictModel):
    """step_s, horizon: grid of times of arrival, up to horizon times the longest measured one."""

    step_s: float = Field(gt=0)
    horizon: float = Field(gt=1)


class PeopleSettings(StrictModel):
    """Everything that decides what comes out of the people study.

    training_people: at most so many are learned from; patience_s, wait_s: see `DecisionEpochs`;
    discount: per second. area: file of the walkable area (WKT, GeoJSON), empty for where people
    were.
    """

    files: tuple[str, ...] = Field(min_length=1)
    columns: TableColumns = TableColumns()
    area: str = ""
    grid: GridSettings
    training_people: int = Field(ge=10)
    patience_s: float = Field(gt=0)
    wait_s: float = Field(gt=0)
    folds: FoldSettings
    forecast: ForecastSettings
    discount: float = Field(gt=0, lt=1)
    seed: int = Field(ge=0)
    statistics: StatisticsSettings


def people_settings(
    files: Sequence[Path],
    *,
    mapping: TableColumns | None = None,
    area: Path | None = None,
    quick: bool = False,
    config: Path | None = None,
) -> PeopleSettings:
    """The defaults, changed by --quick and a YAML file; FileError with one sentence."""
    given: dict[str, Any] = {"files": [str(path) for path in files]}
    if mapping is not None:
        given["columns"] = mapping.model_dump(mode="json")
    if area is not None:
        given["area"] = str(area)
    return merged_settings(PeopleSettings, YAML, quick=quick, config=config, given=given)
