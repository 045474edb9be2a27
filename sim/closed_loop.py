"""The closed-loop benchmark's plan: scenarios x densities x with or against the flow x seeds.

Each planner drives all of it told of people as they are, and half as many seeds from the lidar's
scans alone.
"""

from dataclasses import dataclass
from itertools import product

from sim.batch import EpisodeTask
from sim.errors import SimError


@dataclass(frozen=True)
class ClosedLoopPlan:
    """What is run; every combination with every seed."""

    scenarios: tuple[str, ...] = ("hallway", "corridor", "t_junction", "crossing")
    n_people: tuple[int, ...] = (30, 60)
    drivers: tuple[str, ...] = ("expert_with_flow", "expert_against_flow")
    planners: tuple[str, ...] = ("dwa", "mppi")
    n_seeds: int = 20
    n_scan_seeds: int = 10

    def __post_init__(self) -> None:
        if self.n_seeds < 1 or self.n_scan_seeds < 0:
            raise SimError(
                "n_seeds must be at least 1 and n_scan_seeds at least 0, got "
                f"{self.n_seeds} and {self.n_scan_seeds}; use 20 and 10"
            )

    @property
    def tasks(self) -> tuple[EpisodeTask, ...]:
        """One task per episode, seed by seed from 1 up; first those with people as given."""
        return (*self._tasks("given", self.n_seeds), *self._tasks("scan", self.n_scan_seeds))

    def _tasks(self, people_from: str, n_seeds: int) -> tuple[EpisodeTask, ...]:
        return tuple(
            EpisodeTask(
                scenario=scenario,
                seed=seed,
                n_people=people,
                planner=planner,
                driver=driver,
                people_from=people_from,
            )
            for seed, planner, scenario, people, driver in product(
                range(1, n_seeds + 1), self.planners, self.scenarios, self.n_people, self.drivers
            )
        )
