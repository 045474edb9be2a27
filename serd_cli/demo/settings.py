"""What a demo runs with; kept beside its results, so that it can be continued or run again."""

from typing import Literal

from pydantic import Field

from storage.yaml_config import StrictModel


class DemoSettings(StrictModel):
    """Seeds: demonstrations use `seed`, the learned policy drives in a world of another one."""

    scenario: str = "hallway"
    seed: int = Field(default=3, ge=0)
    demonstrations: int = Field(default=20, ge=1)
    episodes: int = Field(default=30, ge=1)
    timeout_s: float = Field(default=420.0, gt=0)
    policy: Literal["optimal", "soft"] = "optimal"

    @property
    def navigation_seed(self) -> int:
        """Seed of the world the learned policy is measured in."""
        return self.seed + 1000
