"""How the strategy drives by a model."""

from typing import Literal

from pydantic import Field

from storage.yaml_config import StrictModel


class NavigationSettings(StrictModel):
    """See the strategy in nodes.yaml for what each means."""

    model: str = Field(min_length=1)
    policy: Literal["optimal", "soft"]
    transfer: bool
    goal: str
    lookahead_cells: int = Field(ge=1)
    patience_periods: int = Field(ge=0)
    minimum_arrival_probability: float = Field(ge=0, le=1)
    seed: int = Field(ge=0)
    timeout_s: float = Field(gt=0)
