"""Closed loop: how the planners drive among people, over scenarios, densities and directions.

The scenarios have a physical robot and people who foresee it. Each planner drives twice: with the
true positions of people, and from the lidar's scans alone. Every condition is driven with the same
seeds. Episodes are kept under .cache until the code of the simulator changes, so an interrupted
run goes on where it stopped.
"""

import hashlib
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from lab.benchmarks.driving.closed_loop_figure import closed_loop_figure
from lab.benchmarks.report import Row, save
from serd_app.report.style import save_figure
from serd_cli.output.terminal import WorkProgress
from serd_files.table import Row as TableRow
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.batch import EpisodeTask, run_batch
from serd_sim.episodes.batch_summary import ConditionSummary, summarise
from serd_sim.episodes.episode import run_episode
from serd_sim.errors import SimError
from serd_sim.planning.catalogue import make_planner, planner_names
from serd_sim.planning.local_planner import LocalPlanner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld

PLAN_CALL_PEOPLE = 20
_ON_ITS_WAY_M = 0.3
ROOT = Path(__file__).resolve().parents[3]
FIGURE = ROOT / "docs" / "pictures" / "closed_loop.png"


@dataclass(frozen=True)
class ClosedLoopPlan:
    """Conditions to drive; every combination with every seed."""

    scenarios: tuple[str, ...] = ("hallway", "corridor", "t_junction", "crossing")
    n_people: tuple[int, ...] = (30, 60)
    drivers: tuple[str, ...] = ("expert_with_flow", "expert_against_flow")
    planners: tuple[str, ...] = ("dwa", "mppi")
    people_from: tuple[str, ...] = ("given", "scan")
    n_seeds: int = 8

    def __post_init__(self) -> None:
        if self.n_seeds < 1:
            raise SimError(f"n_seeds must be at least 1, got {self.n_seeds}; use 20")

    @property
    def tasks(self) -> tuple[EpisodeTask, ...]:
        """One task per episode, seed by seed from 1 up."""
        conditions = {
            "seed": range(1, self.n_seeds + 1),
            "people_from": self.people_from,
            "planner": self.planners,
            "scenario": self.scenarios,
            "n_people": self.n_people,
            "driver": self.drivers,
        }
        return tuple(
            EpisodeTask(**dict(zip(conditions, each, strict=True)))
            for each in product(*conditions.values())
        )


def run() -> None:
    """Drive all episodes that are missing, then write table and figure."""
    plan = ClosedLoopPlan()
    table = ROOT / ".cache" / "benchmarks" / f"closed_loop_{code_digest()}.csv"
    summaries = summarise(drive_all("closed loop", plan.tasks, table))
    save_figure(FIGURE, closed_loop_figure(summaries))
    save(
        "closed_loop",
        f"Closed loop, {plan.n_seeds} episodes each; contacts are those of all of them",
        [_row(each) for each in summaries],
    )
    save(
        "plan_call",
        f"Milliseconds of processor time of one plan call among {PLAN_CALL_PEOPLE} people",
        [_plan_call(name) for name in planner_names()],
    )


def drive_all(
    title: str, tasks: Sequence[EpisodeTask], table: Path, **kinds: Any
) -> list[TableRow]:
    """Rows of all tasks, from the table where they are there already, with a progress bar.

    kinds: of `run_batch`, for tasks that are not the usual ones.
    """
    progress = WorkProgress(
        TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )
    with progress:
        line = progress.add_task("")
        return run_batch(
            tasks,
            table,
            **kinds,
            on_progress=lambda done, total: progress.update(line, completed=done, total=total),
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
        "planner": summary.planner,
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


class _Timed:
    """A planner whose calls are timed while it is on its way: at the waypoint it just stands."""

    def __init__(self, planner: LocalPlanner) -> None:
        self._planner = planner
        self.seconds: list[float] = []

    def reset(self) -> None:
        self._planner.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        start_s = time.thread_time()
        command = self._planner.step(observation, waypoint)
        duration_s = time.thread_time() - start_s
        if waypoint is not None:
            away = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
            if math.hypot(*away) > _ON_ITS_WAY_M:
                self.seconds.append(duration_s)
        return command


def _plan_call(name: str) -> Row:
    """One drive through the hallway against the flow, where most people are near."""
    scenario = load_scenario("hallway").with_pedestrian_count(PLAN_CALL_PEOPLE)
    planner = _Timed(make_planner(name, scenario))
    driver = make_driver("expert_against_flow", scenario, 1)
    with HallwayWorld(scenario, seed=1) as world:
        run_episode(world, planner, driver, episode=0)
    milliseconds = 1e3 * np.array(planner.seconds)
    return {
        "planner": name,
        "calls": len(milliseconds),
        "median_ms": float(np.median(milliseconds)),
        "95_percent_below_ms": float(np.percentile(milliseconds, 95)),
        "maximum_ms": float(milliseconds.max()),
    }
