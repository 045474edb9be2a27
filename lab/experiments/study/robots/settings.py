"""Settings of the study of four robots: robots_study.yaml, with what a file or --quick changes."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal, get_args

from pydantic import Field

from lab.experiments.running.statistics import StatisticsSettings
from lab.experiments.study.settings import merged_settings
from serd_files.yaml_config import StrictModel
from serd_sim.scenario.scenario import Scenario, load_scenario

YAML = Path(__file__).parent / "robots_study.yaml"

RobotName = Literal["serd", "irl", "shortest", "goal", "serd_norm", "irl_norm"]
ROBOTS: tuple[RobotName, ...] = get_args(RobotName)
#: Start areas of the two tasks: the first is the one that is demonstrated.
TASKS = ("train", "transfer")


class PlaceSettings(StrictModel):
    """A place with its people; scenario: a name, or a file beside the settings."""

    scenario: str
    people: int = Field(ge=1)
    repetitions: int = Field(ge=0)
    drives: int = Field(ge=2)
    robots: tuple[RobotName, ...] = Field(ROBOTS, min_length=1)


class RobotsSettings(StrictModel):
    """Everything that decides what comes out of the study."""

    discount: float = Field(gt=0, lt=1)
    seed: int = Field(ge=0)
    demonstrations: int = Field(ge=2)
    places: dict[str, PlaceSettings]
    statistics: StatisticsSettings

    @property
    def parts(self) -> tuple[tuple[str, int], ...]:
        """(place, repetition) of each set of demonstrations."""
        return tuple(
            (name, number)
            for name, place in self.places.items()
            for number in range(place.repetitions)
        )


@dataclass(frozen=True)
class RobotsStudy:
    """The study; all its tasks get it."""

    settings: RobotsSettings
    folder: Path

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """That of each place, with its people."""
        return {name: _scenario_of(place) for name, place in self.settings.places.items()}

    def seed_of(self, place: str, repetition: int) -> int:
        """Of the demonstrations of a repetition; the drives have the next one."""
        number = list(self.settings.places).index(place)
        return self.settings.seed + 10_000 * number + 10 * repetition


def robots_settings(*, quick: bool = False, config: Path | None = None) -> RobotsSettings:
    """The defaults, changed by --quick and a YAML file; FileError with one sentence."""
    return merged_settings(RobotsSettings, YAML, quick=quick, config=config)


def _scenario_of(place: PlaceSettings) -> Scenario:
    own = YAML.with_name(place.scenario)
    scenario = load_scenario(own if own.is_file() else place.scenario)
    return scenario.with_pedestrian_count(place.people)
