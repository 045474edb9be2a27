"""Summary of the rows of a batch: one line per condition."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from scipy.stats import binomtest

from storage.row_table import Row

_CONDITION = ("planner", "scenario", "n_people", "start_area", "driver", "people_from")
_AVERAGED = (
    "intimate_share",
    "personal_share",
    "robot_on_person",
    "person_on_robot",
    "robot_on_wall",
    "mean_abs_acceleration_mps2",
    "mean_abs_turn_acceleration_radps2",
)


@dataclass(frozen=True)
class ConditionSummary:
    """One line of the table.

    n_people: None for the scenario's own number. arrival_low, arrival_high: Wilson's 95 % interval.
    Contacts are per episode, shares of time; NaN where no episode arrived.
    """

    planner: str
    scenario: str
    n_people: int | None
    start_area: str
    driver: str
    people_from: str
    n_episodes: int
    n_arrived: int
    arrival_low: float
    arrival_high: float
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

    @property
    def arrival_rate(self) -> float:
        """Share of the episodes that arrived."""
        return self.n_arrived / self.n_episodes


def summarise(rows: Sequence[Row]) -> list[ConditionSummary]:
    """One summary per condition, in the order they first appear."""
    conditions: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        conditions.setdefault(tuple(row[name] for name in _CONDITION), []).append(row)
    return [_summary(group) for group in conditions.values()]


def wilson_interval(n_hits: int, n_tries: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    interval = binomtest(n_hits, n_tries).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def _summary(group: list[Row]) -> ConditionSummary:
    arrived = [float(row["time_of_arrival_s"]) for row in group if row["outcome"] == "arrived"]
    first = group[0]
    means: dict[str, Any] = {name: fmean(float(row[name]) for row in group) for name in _AVERAGED}
    low, high = wilson_interval(len(arrived), len(group))
    return ConditionSummary(
        **{name: first[name] for name in _CONDITION},
        **means,
        n_episodes=len(group),
        n_arrived=len(arrived),
        arrival_low=low,
        arrival_high=high,
        mean_time_of_arrival_s=fmean(arrived) if arrived else float("nan"),
        mean_distance_m=fmean(float(row["distance_m"]) for row in group),
        minimum_person_distance_m=min(float(row["minimum_person_distance_m"]) for row in group),
    )
