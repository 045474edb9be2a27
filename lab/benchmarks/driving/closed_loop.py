"""Closed loop: how the planner drives among people, over scenarios, densities and directions.

The scenarios have a physical robot and people who foresee it. It drives twice: with the true
positions of people, and from the lidar's scans alone. Every condition is driven with the same
seeds. Episodes are kept under .cache until the code of the simulator changes, so an interrupted
run goes on where it stopped.
"""

import hashlib
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from lab.benchmarks.report import Row, save
from serd_cli.output.terminal import WorkProgress
from serd_sim.episodes.batch import ConditionSummary, EpisodeTask, run_batch, summarise

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class ClosedLoopPlan:
    """Conditions to drive; every combination with every seed."""

    scenarios: tuple[str, ...] = ("hallway", "corridor", "t_junction", "crossing")
    n_people: tuple[int, ...] = (30, 60)
    drivers: tuple[str, ...] = ("expert_with_flow", "expert_against_flow")
    people_from: tuple[str, ...] = ("given", "scan")
    n_seeds: int = 8

    @property
    def tasks(self) -> tuple[EpisodeTask, ...]:
        """One task per episode, seed by seed from 1 up."""
        conditions = {
            "seed": range(1, self.n_seeds + 1),
            "people_from": self.people_from,
            "scenario": self.scenarios,
            "n_people": self.n_people,
            "driver": self.drivers,
        }
        return tuple(
            EpisodeTask(**dict(zip(conditions, each, strict=True)))
            for each in product(*conditions.values())
        )


def run() -> None:
    """Drive all episodes that are missing, then write the table."""
    plan = ClosedLoopPlan()
    table = ROOT / ".cache" / "benchmarks" / f"closed_loop_{code_digest()}.csv"
    progress = WorkProgress(
        TextColumn("closed loop"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )
    with progress:
        line = progress.add_task("")
        rows = run_batch(
            plan.tasks,
            table,
            on_progress=lambda done, total: progress.update(line, completed=done, total=total),
        )
    save(
        "closed_loop",
        f"Closed loop, {plan.n_seeds} episodes each; contacts are those of all of them",
        [_row(each) for each in summarise(rows)],
    )


def code_digest() -> str:
    """Digest of all code and scenarios that episodes depend on."""
    digest = hashlib.sha256()
    for package in ("serd_core", "sim"):
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in (".py", ".yaml", ".urdf") and path.parent.name != "pictures":
                digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _row(summary: ConditionSummary) -> Row:
    direction = summary.driver.removeprefix("expert_").replace("_flow", "")
    count = summary.n_episodes
    return {
        "people_from": summary.people_from,
        "scenario": summary.scenario,
        "people": summary.n_people,
        "flow": direction,
        "arrived": f"{summary.n_arrived} of {count}",
        "arrival_low": summary.arrival_low,
        "arrival_high": summary.arrival_high,
        "time_s": summary.mean_time_of_arrival_s,
        "way_m": summary.mean_distance_m,
        "nearest_m": summary.minimum_person_distance_m,
        "intimate": summary.metrics.intimate_share,
        "personal": summary.metrics.personal_share,
        "standing": summary.metrics.standing_share,
        "robot_on_person": round(summary.robot_on_person * count),
        "person_on_robot": round(summary.person_on_robot * count),
        "robot_on_wall": round(summary.robot_on_wall * count),
        "change_mps2": summary.metrics.mean_abs_acceleration_mps2,
        "change_radps2": summary.metrics.mean_abs_turn_acceleration_radps2,
    }
