"""The closed-loop benchmark's plan: scenarios x densities x with or against the flow x seeds.

Each planner drives all of it told of people as they are, and again from the lidar's scans alone.
"""

from dataclasses import dataclass
from itertools import product

from sim.episodes.batch import EpisodeTask
from sim.errors import SimError


@dataclass(frozen=True)
class ClosedLoopPlan:
    """What is run; every combination with every seed."""

    scenarios: tuple[str, ...] = ("hallway", "corridor", "t_junction", "crossing")
    n_people: tuple[int, ...] = (30, 60)
    drivers: tuple[str, ...] = ("expert_with_flow", "expert_against_flow")
    planners: tuple[str, ...] = ("dwa", "mppi")
    people_from: tuple[str, ...] = ("given", "scan")
    n_seeds: int = 20

    def __post_init__(self) -> None:
        if self.n_seeds < 1:
            raise SimError(f"n_seeds must be at least 1, got {self.n_seeds}; use 20")

    @property
    def tasks(self) -> tuple[EpisodeTask, ...]:
        """One task per episode, seed by seed from 1 up."""
        return tuple(
            EpisodeTask(
                scenario=scenario,
                seed=seed,
                n_people=people,
                planner=planner,
                driver=driver,
                people_from=source,
            )
            for source, seed, planner, scenario, people, driver in product(
                self.people_from,
                range(1, self.n_seeds + 1),
                self.planners,
                self.scenarios,
                self.n_people,
                self.drivers,
            )
        )
