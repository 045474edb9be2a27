"""Settings of the detour study: detour_study.yaml, with what a file or --quick changes."""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated

from pydantic import Field

from lab.experiments.study.settings import Sizes, WorldSettings, merged_settings
from lab.experiments.study.study import StudyWorld
from serd_files.yaml_config import StrictModel

YAML = Path(__file__).parent / "detour_study.yaml"


class DecoySettings(StrictModel):
    """Demonstrations sampled under dynamics whose P(forward | against) is given."""

    truths: tuple[Annotated[float, Field(gt=0, lt=1)], ...] = Field(min_length=1)
    repetitions: int = Field(ge=1)
    sizes: Sizes = Field(min_length=1)

    @property
    def parts(self) -> tuple[tuple[int, int], ...]:
        """(number of the truth, repetition) of each set."""
        return tuple(product(range(len(self.truths)), range(self.repetitions)))


class DetourSettings(WorldSettings):
    """Everything that decides what comes out of the detour study."""

    expert_weights: tuple[float, float, float]
    pseudo_counts: tuple[Annotated[float, Field(gt=0)], ...] = Field(min_length=1)
    drives: int = Field(ge=1)
    decoy: DecoySettings

    @property
    def planned_weights(self) -> tuple[float, ...]:
        """Reward weights of the expert."""
        return self.expert_weights


@dataclass(frozen=True)
class DetourStudy(StudyWorld):
    """The detour study; all its tasks get it."""

    settings: DetourSettings


def detour_settings(*, quick: bool = False, config: Path | None = None) -> DetourSettings:
    """The defaults, changed by --quick and a YAML file; FileError with one sentence."""
    return merged_settings(DetourSettings, YAML, quick=quick, config=config)
