"""What `serd batch` prints: a row per condition of arrivals, contacts and metrics."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from serd_cli.output.terminal import console, finite_values, table_of
from serd_sim.episodes.batch import ConditionSummary


def print_episodes(summaries: Sequence[ConditionSummary], output: Path) -> None:
    """Both tables, and where the rows are."""
    console.print(summary_table(summaries))
    console.print(metrics_table(summaries))
    print(f"episodes: {output.resolve()}")


def summary_values(summaries: Sequence[ConditionSummary]) -> list[dict[str, Any]]:
    """The same by name, None for numbers that are not finite."""
    return [finite_values(asdict(each)) for each in summaries]


def summary_table(summaries: Sequence[ConditionSummary]) -> Table:
    """One row per condition; contacts are those of all its episodes."""
    table = table_of("Episodes", "condition", ("arrived", "95 % interval", "time", "way"))
    table.add_column("robot into people, people into robot, walls", justify="right", max_width=20)
    for each in summaries:
        contacts = (each.robot_on_person, each.person_on_robot, each.robot_on_wall)
        table.add_row(
            _condition(each),
            f"{each.n_arrived} of {each.n_episodes}",
            f"{100 * each.arrival_low:.0f}-{100 * each.arrival_high:.0f} %",
            f"{each.mean_time_of_arrival_s:.1f} s" if each.n_arrived else "",
            f"{each.mean_distance_m:.1f} m",
            ", ".join(f"{round(per * each.n_episodes)}" for per in contacts),
        )
    return table


def metrics_table(summaries: Sequence[ConditionSummary]) -> Table:
    """One row per condition: the way, nearness to people and smoothness."""
    names = ("stands", "personal zone", "collision < 1 s", "jerk", "turns")
    table = table_of("Means over the episodes", "condition", names)
    for each in summaries:
        metrics = each.metrics
        table.add_row(
            _condition(each),
            f"{100 * metrics.standing_share:.0f} %",
            f"{100 * metrics.personal_share:.0f} %",
            f"{100 * metrics.collision_ahead_share:.1f} %",
            f"{metrics.mean_abs_jerk_mps3:.1f} m/s³",
            f"{metrics.path_irregularity_radpm:.2f} rad/m",
        )
    return table


def _condition(summary: ConditionSummary) -> str:
    people = "" if summary.n_people is None else f", {summary.n_people} people"
    seen = ", from scans" if summary.people_from == "scan" else ""
    seen += "" if summary.guarded else ", without guard"
    return f"{summary.scenario}{people}, from {summary.start_area}: {summary.driver}{seen}"
