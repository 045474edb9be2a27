"""Summary of the rows of a batch: one line per condition."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from math import isnan, nan
from statistics import fmean
from typing import Any

from serd_core.arrival.law import clopper_pearson
from serd_files.table import Row
from serd_sim.episodes.metrics import EpisodeMetrics
from serd_sim.robot.contacts import ContactCounts

_CONDITION = ("planner", "scenario", "n_people", "start_area", "driver", "people_from", "guarded")


@dataclass(frozen=True)
class ConditionSummary:
    """One line of the table.

    n_people: None for the scenario's own number. arrival_low, arrival_high: exact 95 % interval.
    Contacts are per episode; metrics: means over the episodes. NaN where no episode arrived.
    """

    planner: str
    scenario: str
    n_people: int | None
    start_area: str
    driver: str
    people_from: str
    guarded: int
    n_episodes: int
    n_arrived: int
    arrival_low: float
    arrival_high: float
    mean_time_of_arrival_s: float
    mean_distance_m: float
    minimum_person_distance_m: float
    spl: float
    robot_on_person: float
    person_on_robot: float
    robot_on_wall: float
    metrics: EpisodeMetrics

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


def _summary(group: list[Row]) -> ConditionSummary:
    arrived = [float(row["time_of_arrival_s"]) for row in group if row["outcome"] == "arrived"]
    first = group[0]
    low, high = (float(end) for end in clopper_pearson(len(arrived), len(group)))
    return ConditionSummary(
        **{name: first[name] for name in _CONDITION},
        **_means(group, ("spl", *_names_of(ContactCounts))),
        metrics=EpisodeMetrics(**_means(group, _names_of(EpisodeMetrics))),
        n_episodes=len(group),
        n_arrived=len(arrived),
        arrival_low=low,
        arrival_high=high,
        mean_time_of_arrival_s=fmean(arrived) if arrived else float("nan"),
        mean_distance_m=fmean(float(row["distance_m"]) for row in group),
        minimum_person_distance_m=min(float(row["minimum_person_distance_m"]) for row in group),
    )


def _means(group: list[Row], names: Sequence[str]) -> dict[str, Any]:
    return {name: _mean(float(row[name]) for row in group) for name in names}


def _mean(values: Iterable[float]) -> float:
    """Over the known ones; NaN where there is none."""
    known = [value for value in values if not isnan(value)]
    return fmean(known) if known else nan


def _names_of(record: type) -> tuple[str, ...]:
    return tuple(each.name for each in fields(record))
