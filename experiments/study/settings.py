"""Settings of the hallway study: hallway_study.yaml, with what a file or --quick changes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from experiments.running.experiment import settings_of_file
from experiments.running.statistics import StatisticsSettings
from experiments.study.recordings.experts import PEOPLE
from serd_app.learning.settings import RecipeSettings
from storage.yaml_config import StrictModel, yaml_model
from storage.yaml_text import write_yaml

FOLDER = Path(__file__).parent
FULL_YAML = FOLDER / "hallway_study.yaml"
QUICK_YAML = FOLDER / "hallway_study_quick.yaml"

Sizes = tuple[int, ...]


class DemonstrationSettings(StrictModel):
    """Episodes of each set of one repetition.

    bags: recordings that take the place of the driver's; empty for none.
    """

    driver: str
    training: int = Field(ge=2)
    test: int = Field(ge=1)
    transfer: int = Field(ge=1)
    bags: tuple[str, ...] = ()


class ReferenceSettings(StrictModel):
    """Episodes of the reference recordings, by who drives."""

    experts: int = Field(ge=1)
    against_flow: int = Field(ge=1)
    exploring: int = Field(ge=1)
    exploring_s: float = Field(gt=0)


class ComparisonSettings(RecipeSettings):
    """How the learners are compared; sizes count demonstrations, validation included."""

    repetitions: int = Field(ge=2)
    sizes: Sizes = Field(min_length=1)


class BeliefSettings(StrictModel):
    """Experts that plan with a known reward and a known belief."""

    repetitions: int = Field(ge=2)
    sizes: Sizes = Field(min_length=1)
    reward_weights: tuple[float, float, float]
    episodes: int = Field(ge=1)


class ArrivalSettings(StrictModel):
    """How times of arrival are predicted and measured."""

    episodes: int = Field(ge=1)
    sampled: int = Field(ge=1)


class StudySettings(StrictModel):
    """Everything that decides what comes out of the study."""

    scenario: str
    people: int = Field(ge=1)
    planner: str
    discount: float = Field(ge=0, lt=1)
    seed: int = Field(ge=0)
    demonstrations: DemonstrationSettings
    reference: ReferenceSettings
    learning: ComparisonSettings
    beliefs: BeliefSettings
    arrival: ArrivalSettings
    statistics: StatisticsSettings

    def n_repetitions(self, expert: str) -> int:
        """How often an expert's demonstrations are recorded anew."""
        return (self.learning if expert == PEOPLE else self.beliefs).repetitions

    @model_validator(mode="after")
    def _sizes_fit(self) -> "StudySettings":
        most = self.demonstrations.training
        for sizes in (self.learning.sizes, self.beliefs.sizes):
            if min(sizes) < 2 or max(sizes) > most or list(sizes) != sorted(set(sizes)):
                raise ValueError(
                    f"sizes must grow from at least 2 to at most demonstrations.training ({most}),"
                    f" got {list(sizes)}"
                )
        return self


def study_settings(
    *, quick: bool = False, config: Path | None = None, bags: Sequence[Path] = ()
) -> StudySettings:
    """The defaults, changed by --quick, a YAML file and bags; FileError with one sentence."""
    values = settings_of_file(FULL_YAML)
    changes = [QUICK_YAML] if quick else []
    changes += [config] if config is not None else []
    for path in changes:
        values = _merged(values, settings_of_file(path))
    if bags:
        values = _merged(values, {"demonstrations": {"bags": [str(bag.resolve()) for bag in bags]}})
    name = " with ".join(map(str, [FULL_YAML.name, *changes]))
    return yaml_model(write_yaml(values), StudySettings, name=name)


def _merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(values)
    for name, change in changes.items():
        both = isinstance(change, dict) and isinstance(merged.get(name), dict)
        merged[name] = _merged(merged[name], change) if both else change
    return merged
