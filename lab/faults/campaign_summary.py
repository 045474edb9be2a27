"""Summary of the rows of a fault campaign: one line per fault, with and without the guard."""

from collections.abc import Sequence

import pandas as pd

from serd_files.table import Row


def summarise_faults(rows: Sequence[Row]) -> pd.DataFrame:
    """One row per fault and guard, in the order they first appear.

    n_episodes: those in which the fault began. Times (s) and distances (m) from there. n_stood: of
    these, where the robot stood. Means and maxima are over those, NaN for none. largest_later_m:
    way after standing. Contacts and input stops are sums, hours simulated time.
    mean_time_of_arrival_s: over the episodes that arrived.
    """
    frame = pd.DataFrame(rows)
    groups = frame[frame["began"] == 1].groupby(["fault", "guarded"], sort=False)
    summary = groups.agg(
        n_episodes=("began", "size"),
        n_stood=("stood_s", "count"),
        mean_zero_s=("zero_s", "mean"),
        largest_zero_s=("zero_s", "max"),
        mean_stood_s=("stood_s", "mean"),
        largest_stood_s=("stood_s", "max"),
        mean_stood_m=("stood_m", "mean"),
        largest_stood_m=("stood_m", "max"),
        largest_later_m=("later_m", "max"),
        robot_on_person=("robot_on_person", "sum"),
        person_on_robot=("person_on_robot", "sum"),
        robot_on_wall=("robot_on_wall", "sum"),
        n_input_stops=("n_input_stops", "sum"),
        n_collision_stops=("n_collision_stops", "sum"),
        hours=("duration_s", "sum"),
        n_arrived=("time_of_arrival_s", "count"),
        mean_time_of_arrival_s=("time_of_arrival_s", "mean"),
    ).reset_index()
    return summary.assign(guarded=summary["guarded"] == 1, hours=summary["hours"] / 3600.0)


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
