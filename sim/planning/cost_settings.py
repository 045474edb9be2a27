"""Settings of what a rollout costs."""

from dataclasses import dataclass

from sim.errors import SimError


@dataclass(frozen=True)
class CostSettings:
    """Margins in metres between surfaces; weights of the terms; foresight_s: how soon matters.

    wall_margin_m: more than half the diagonal of a cell of the wall raster (0.035 m).
    person_margin_m, stopped_margin_m: to somebody who walks straight on, and who stops.
    """

    wall_margin_m: float = 0.05
    person_margin_m: float = 0.08
    stopped_margin_m: float = 0.02
    people_range_m: float = 3.5
    max_people: int = 8
    progress_weight: float = 1.0
    staying_weight: float = 0.3
    heading_weight: float = 0.25
    people_weight: float = 1.2
    people_decay_m: float = 0.25
    foresight_s: float = 0.8
    wall_weight: float = 0.3
    wall_decay_m: float = 0.12

    def __post_init__(self) -> None:
        for name in ("people_decay_m", "foresight_s", "wall_decay_m", "people_range_m"):
            if not getattr(self, name) > 0:
                raise SimError(f"{name} must be above 0, got {getattr(self, name)}; raise it")
