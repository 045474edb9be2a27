"""Settings of the density study: density_study.yaml, with what a file or --quick changes."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator

from lab.experiments.running.statistics import StatisticsSettings
from lab.experiments.study.settings import merged_settings
from lab.experiments.study.study import scenario_with
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.grid import navigation_problem_of
from sim.scenario.scenario import Scenario
from storage.yaml_config import StrictModel

YAML = Path(__file__).parent / "density_study.yaml"
Crowds = tuple[Annotated[int, Field(ge=1)], ...]


class DensitySettings(StrictModel):
    """Everything that decides what comes out of the density study."""

    scenario: str
    crowd: str
    drive: str
    planner: str
    driver: str
    discount: float = Field(ge=0, lt=1)
    seed: int = Field(ge=0)
    repetitions: int = Field(ge=2)
    learned_from: Crowds = Field(min_length=1)
    demonstrations: int = Field(ge=1)
    predicted: Crowds = Field(min_length=1)
    held_out: int = Field(ge=1)
    drives: int = Field(ge=1)
    statistics: StatisticsSettings

    @field_validator("learned_from", "predicted")
    @classmethod
    def _each_once(cls, crowds: Crowds) -> Crowds:
        if len(set(crowds)) < len(crowds):
            raise ValueError(f"must name each number of people once, got {list(crowds)}")
        return crowds

    @property
    def crowds(self) -> Crowds:
        """All numbers of people."""
        return tuple(dict.fromkeys((*self.learned_from, *self.predicted)))


@dataclass(frozen=True)
class DensityStudy:
    """Settings, and the folder of the stages."""

    settings: DensitySettings
    folder: Path

    def scenario(self, people: int) -> Scenario:
        """The place with a number of people."""
        settings = self.settings
        return scenario_with(settings.scenario, people, crowd=settings.crowd, drive=settings.drive)

    @cached_property
    def problem(self) -> NavigationProblem:
        """The decision problem of section 5.1, the same for every crowd."""
        return navigation_problem_of(self.scenario(1), self.settings.discount)

    def seed(self, people: int, repetition: int, purpose: int) -> int:
        """Of the world of a recording."""
        return self.settings.seed + 1000 * people + 10 * repetition + purpose


def density_settings(*, quick: bool = False, config: Path | None = None) -> DensitySettings:
    """The defaults, changed by --quick and a YAML file; FileError with one sentence."""
    return merged_settings(DensitySettings, YAML, quick=quick, config=config)
