"""The closed-loop benchmark: scenarios x densities x with or against the flow x seeds.

One condition is one line of the table: all its episodes together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import product
from statistics import fmean

from sim.batch import EpisodeTask, Row
from sim.errors import SimError


@dataclass(frozen=True)
class ClosedLoopPlan:
    """What is run; every combination with every seed."""

    scenarios: tuple[str, ...] = ("hallway", "corridor", "t_junction", "crossing")
    n_people: tuple[int, ...] = (30, 60)
    drivers: tuple[str, ...] = ("expert_with_flow", "expert_against_flow")
    planners: tuple[str, ...] = ("dwa", "mppi")
    n_seeds: int = 20

    def __post_init__(self) -> None:
        if self.n_seeds < 1:
            raise SimError(f"n_seeds must be at least 1, got {self.n_seeds}; use 20")

    @property
    def tasks(self) -> tuple[EpisodeTask, ...]:
        """One task per episode, seeds 1 to n_seeds."""
        return tuple(
            EpisodeTask(
                scenario=scenario, seed=seed, n_people=people, planner=planner, driver=driver
            )
            for planner, scenario, people, driver, seed in product(
                self.planners,
                self.scenarios,
                self.n_people,
                self.drivers,
                range(1, self.n_seeds + 1),
            )
        )


@dataclass(frozen=True)
class ConditionSummary:
    """One line of the table. Contacts are per episode, shares of time; NaN where none arrived."""

    planner: str
    scenario: str
    n_people: int
    driver: str
    n_episodes: int
    arrival_rate: float
    mean_time_of_arrival_s: float
    mean_distance_m: float
    minimum_person_distance_m: float
    intimate_share: float
    personal_share: float
    robot_on_person: float
    person_on_robot: float
    robot_on_wall: float
    mean_abs_acceleration_mps2: float
    mean_abs_turn_acceleration_radps2: float


def summarise(rows: Sequence[Row]) -> list[ConditionSummary]:
    """One summary per condition, in the order they first appear."""
    conditions: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        key = (row["planner"], row["scenario"], row["n_people"], row["driver"])
        conditions.setdefault(key, []).append(row)
    return [_summary(group) for group in conditions.values()]


def _summary(group: list[Row]) -> ConditionSummary:
    first = group[0]
    arrived = [row for row in group if row["outcome"] == "arrived"]
    averaged = {
        each.name: fmean(float(row[each.name]) for row in group)
        for each in fields(ConditionSummary)
        if each.name in first and each.type in ("float", float)
    }
    return ConditionSummary(
        **{
            **averaged,
            "planner": first["planner"],
            "scenario": first["scenario"],
            "n_people": first["n_people"],
            "driver": first["driver"],
            "n_episodes": len(group),
            "arrival_rate": len(arrived) / len(group),
            "mean_time_of_arrival_s": _mean([float(row["time_of_arrival_s"]) for row in arrived]),
            "mean_distance_m": _mean([float(row["distance_m"]) for row in group]),
            "minimum_person_distance_m": min(float(r["minimum_person_distance_m"]) for r in group),
        }
    )


def _mean(values: list[float]) -> float:
    return fmean(values) if values else float("nan")
