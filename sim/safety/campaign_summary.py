"""Summary of the rows of a fault campaign: one line per fault, with and without the guard."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from sim.safety.faults import FAULTS
from storage.row_table import Row


@dataclass(frozen=True)
class FaultSummary:
    """n_episodes: those in which the fault began. Times (s) and distances (m) from there.

    n_stood: of these, where the robot stood. Means and maxima are over those, NaN for none.
    largest_later_m: way after standing. Contacts and input stops are sums, hours simulated time.
    mean_time_of_arrival_s: over the episodes that arrived.
    """

    fault: str
    guarded: bool
    n_episodes: int
    n_stood: int
    mean_zero_s: float
    largest_zero_s: float
    mean_stood_s: float
    largest_stood_s: float
    mean_stood_m: float
    largest_stood_m: float
    largest_later_m: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    n_input_stops: int
    n_collision_stops: int
    hours: float
    n_arrived: int
    mean_time_of_arrival_s: float

    @property
    def about(self) -> str:
        """What the fault is."""
        return FAULTS[self.fault].about


def summarise_faults(rows: Sequence[Row]) -> list[FaultSummary]:
    """One summary per fault and guard, in the order they first appear."""
    frame = pd.DataFrame(rows)
    groups = frame[frame["began"] == 1].groupby(["fault", "guarded"], sort=False)
    return [_summary(str(fault), bool(guarded), group) for (fault, guarded), group in groups]


def arrival_price(rows: Sequence[Row], fault: str) -> float:
    """Relative increase of the mean time of arrival by the guard, where a seed arrives in both."""
    frame = pd.DataFrame(rows)
    times = (
        frame[frame["fault"] == fault]
        .pivot_table(index="seed", columns="guarded", values="time_of_arrival_s")
        .dropna()
    )
    if not {0, 1} <= {*times.columns}:
        return float("nan")
    return float(times[1].mean() / times[0].mean() - 1.0)


def _summary(fault: str, guarded: bool, group: pd.DataFrame) -> FaultSummary:
    means = group[["zero_s", "stood_s", "stood_m"]].mean().add_prefix("mean_")
    largest = group[["zero_s", "stood_s", "stood_m"]].max().add_prefix("largest_")
    sums: dict[str, Any] = {
        name: int(group[name].sum())
        for name in (
            "robot_on_person",
            "person_on_robot",
            "robot_on_wall",
            "n_input_stops",
            "n_collision_stops",
        )
    }
    return FaultSummary(
        fault=fault,
        guarded=guarded,
        n_episodes=len(group),
        n_stood=int(group["stood_s"].notna().sum()),
        largest_later_m=float(group["later_m"].max()),
        hours=float(group["duration_s"].sum()) / 3600.0,
        n_arrived=int(group["time_of_arrival_s"].notna().sum()),
        mean_time_of_arrival_s=float(group["time_of_arrival_s"].mean()),
        **means.to_dict(),
        **largest.to_dict(),
        **sums,
    )
