"""Settings of a study: its YAML file, with what another file or --quick changes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import Field, model_validator

from lab.experiments.running.experiment import settings_of_file
from lab.experiments.running.statistics import StatisticsSettings
from lab.experiments.study.recordings.experts import PEOPLE
from serd_app.learning.settings import RecipeSettings
from serd_files.yaml_config import StrictModel, write_yaml, yaml_model

YAML = Path(__file__).parent / "hallway_study.yaml"

Sizes = tuple[int, ...]


class DemonstrationSettings(StrictModel):
    """Episodes of each set of one repetition."""

    driver: str
    training: int = Field(ge=2)
    test: int = Field(ge=1)
    transfer: int = Field(ge=1)


class ReferenceSettings(StrictModel):
    """Episodes of the reference recordings, by who drives."""

    experts: int = Field(ge=1)
    against_flow: int = Field(ge=1)
    exploring: int = Field(ge=1)
    exploring_s: float = Field(gt=0)


class ComparisonSettings(RecipeSettings):
    """How the learners are compared; sizes count demonstrations, validation included.

    entropy_slack: of matched features, times the weights. reirl_...: candidate shares of
    Hoeffding's thresholds, pseudo-counts of the sampling policy, sampled trajectories, decisions.
    """

    repetitions: int = Field(ge=2)
    sizes: Sizes = Field(min_length=1)
    entropy_slack: float = Field(0.001, ge=0)
    reirl_threshold_shares: tuple[float, ...] = Field((0.0, 0.03, 0.1), min_length=1)
    reirl_smoothing: tuple[float, ...] = Field((0.03, 0.1, 0.3), min_length=1)
    reirl_samples: int = Field(500, ge=1)
    reirl_sample_decisions: int = Field(210, ge=1)


class BeliefSettings(StrictModel):
    """Experts that plan with a known reward and a known belief."""

    repetitions: int = Field(ge=2)
    sizes: Sizes = Field(min_length=1)
    reward_weights: tuple[float, float, float]
    episodes: int = Field(ge=1)


class ArrivalSettings(StrictModel):
    """How times of arrival are predicted and measured."""

    episodes: int = Field(ge=1)


class StudySettings(StrictModel):
    """Everything that decides what comes out of the hallway study."""

    scenario: str
    people: int = Field(ge=1)
    crowd: str
    drive: str
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

    def repetitions_of(self, experts: Sequence[str]) -> list[tuple[str, int]]:
        """(expert, number) of each repetition."""
        return [(each, number) for each in experts for number in range(self.n_repetitions(each))]

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


SettingsT = TypeVar("SettingsT", bound=StrictModel)


def study_settings(*, quick: bool = False, config: Path | None = None) -> StudySettings:
    """The settings of the hallway study."""
    return merged_settings(StudySettings, YAML, quick=quick, config=config)


def merged_settings(
    model: type[SettingsT],
    defaults: Path,
    *,
    quick: bool,
    config: Path | None,
    given: Mapping[str, Any] = MappingProxyType({}),
) -> SettingsT:
    """The defaults, changed by *_quick.yaml beside them, a user's file and values.

    FileError with one sentence where they do not fit the model.
    """
    files = [defaults.with_stem(f"{defaults.stem}_quick")] if quick else []
    files += [config] if config is not None else []
    values = settings_of_file(defaults)
    for path in files:
        values = _merged(values, settings_of_file(path))
    name = " with ".join(map(str, [defaults.name, *files]))
    return yaml_model(write_yaml(_merged(values, given)), model, name=name)


def _merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(values)
    for name, change in changes.items():
        both = isinstance(change, dict) and isinstance(merged.get(name), dict)
        merged[name] = _merged(merged[name], change) if both else change
    return merged
