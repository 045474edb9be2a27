"""The physical drive beside the kinematic one: the same seeds, arrivals, contacts and cost.

Episodes are kept in lab/results/drives.jsonl, so an interrupted run goes on where it stopped.
"""

import math
import time
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from lab.benchmarks.driving.step_profile import profile_steps
from lab.benchmarks.report import measured_rows, save
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.world import HallwayWorld

SEEDS = range(1, 7)
SCENARIOS = ("hallway", "crossing")
DRIVERS = ("expert_with_flow", "expert_against_flow")
DRIVES = ("kinematic", "physical")
CONTACTS = ("robot_on_person", "person_on_robot", "robot_on_wall")
N_PEOPLE = 30


def run() -> None:
    """Drive what is missing, then write the table of both drives and the cost of a step."""
    cases = (
        {"seed": seed, "scenario": scenario, "driver": driver, "drive": drive}
        for seed, scenario, driver, drive in product(SEEDS, SCENARIOS, DRIVERS, DRIVES)
    )
    rows = pd.DataFrame(measured_rows("drives", cases, episode))
    save(
        "drives",
        f"Both drives with {N_PEOPLE} people and the dynamic window, {len(SEEDS)} episodes each; "
        "sums of contacts",
        [summary(*group) for group in rows.groupby(["scenario", "driver", "drive"], sort=False)],
        {"step_us": {drive: _step_us(drive) for drive in DRIVES}},
    )


def episode(*, seed: int, scenario: str, driver: str, drive: str) -> dict[str, Any]:
    """One episode; process_us: processor time of a tick."""
    place = driven_by(scenario, drive)
    with HallwayWorld(place, seed=seed) as world:
        began_s = time.process_time()
        record = run_episode(
            world, make_planner("dwa", place), make_driver(driver, place, seed), episode=0
        )
        process_s = time.process_time() - began_s
        events, pose, odometry = world.contact_events, world.observation.pose, world.odometry_pose
    return {
        "outcome": record.outcome,
        "time_s": record.duration_s,
        "way_m": record.distance_m,
        **{name: getattr(record.contacts, name) for name in CONTACTS},
        "impulses_ns": [round(event.impulse_ns, 2) for event in events],
        "closing_mps": [round(event.closing_mps, 3) for event in events],
        "odometry_error_m": math.dist(pose[:2], odometry[:2]),
        "process_us": 1e6 * process_s / record.n_ticks,
    }


def driven_by(scenario: str, drive: str) -> Scenario:
    """The scenario with that drive and `N_PEOPLE` people."""
    place = load_scenario(scenario).with_pedestrian_count(N_PEOPLE)
    return place.with_values("robot", drive=drive)


def summary(condition: tuple[str, ...], rows: pd.DataFrame) -> dict[str, Any]:
    """One row of the table."""
    impulses = np.concatenate([*rows["impulses_ns"], []])
    arrived = rows[rows["outcome"] == "arrived"]
    return {
        **dict(zip(("scenario", "driver", "drive"), condition, strict=True)),
        "arrived": f"{len(arrived)} of {len(rows)}",
        "time_s": float(arrived["time_s"].mean()),
        "way_m": float(arrived["way_m"].mean()),
        **{name: int(rows[name].sum()) for name in CONTACTS},
        "median_impulse_ns": float(np.median(impulses)) if len(impulses) else None,
        "largest_impulse_ns": float(impulses.max(initial=0.0)),
        "odometry_error_m": float(rows["odometry_error_m"].mean()),
        "process_us": float(rows["process_us"].median()),
    }


def _step_us(drive: str) -> dict[str, float]:
    """Microseconds of each part of a step, and of all."""
    profile = profile_steps(driven_by("hallway", drive), seed=1, episodes=1)
    return {**profile.parts_us, "step": profile.step_us}
