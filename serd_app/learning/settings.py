"""Settings of learning: the recipe that product and study share, and what a command adds."""

from typing import Annotated, Literal

from pydantic import Field

from serd_files.settings import setting
from serd_files.yaml_config import StrictModel

MethodName = Literal[
    "mdce_serd",
    "mdce_serd_evidence",
    "mdce_serd_coupled",
    "mdce_serd_free",
    "mdce_irl",
]


#: Which way people walk; auto: as the scenario states, else as recorded, else unknown.
FlowSource = Literal["auto", "scenario", "recorded", "none"]


class RecipeSettings(StrictModel):
    """What decides a fit besides the demonstrations; every learner reads its own part."""

    prior_weights: tuple[Annotated[float, Field(ge=0)], ...] = setting(
        (0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0),
        "candidate weights lambda of the divergence prior, chosen on validation episodes",
        min_length=1,
    )
    default_prior_weight: float = setting(
        10.0, "weight lambda where a single episode leaves none for validation", ge=0
    )
    validation_share: float = setting(
        0.15, "share of the episodes on which weights are compared", gt=0, lt=1
    )
    reward_deviation: float = setting(
        30.0, "standard deviation of the normal prior on reward weights", gt=0
    )
    pseudo_count: float = setting(1.0, "uniform prior of the M-estimate: added counts", gt=0)


class LearningSettings(RecipeSettings):
    """How a command or node learns from decisions."""

    method: MethodName = setting("mdce_serd_evidence", "learning method")
    minimum_decisions: int = setting(20, "refuse to learn from fewer decisions", live="any", ge=1)
    seed: int = setting(0, "seed of the choice of validation episodes and of samples", ge=0)
    discount: float = setting(0.99, "discount of the reward", ge=0, lt=1)
