"""People of the lidar tracker beside the true ones, while the scripted expert drives among them.

A person counts while within 5 m of the robot with no other body on the line to the centre. A track
within 0.4 m of a person is that person's; a track without a person within 0.4 m is nobody.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lab.benchmarks.report import save
from serd_core.arrays import BoolArray, FloatArray
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.perception.lidar_people import LidarPeople
from serd_sim.planning.catalogue import make_planner
from serd_sim.safety.reasons import Fault
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation, People
from serd_sim.world.world import HallwayWorld

SEEDS = range(1, 4)
NOISE_M, BODY_M, REACH_M, MATCH_M = 0.02, 0.25, 5.0, 0.4
#: Tracks have a velocity after this time of an episode.
SETTLED_S = 1.0
CASES: tuple[Mapping[str, float], ...] = (
    {"people": 24, "pose_m": 0.0, "pose_rad": 0.0, "wall_margin": 0.12},
    {"people": 60, "pose_m": 0.0, "pose_rad": 0.0, "wall_margin": 0.12},
    {"people": 24, "pose_m": 0.03, "pose_rad": 0.01, "wall_margin": 0.12},
    {"people": 24, "pose_m": 0.03, "pose_rad": 0.01, "wall_margin": 0.25},
)


def run() -> None:
    """Drive all cases and write the table."""
    about = f"LidarPeople in the hallway, {len(SEEDS)} episodes each, range noise {NOISE_M} m"
    save("tracker", about, [{**case, **_measured(case)} for case in CASES])


def in_sight(robot_m: FloatArray, people_m: FloatArray) -> BoolArray:
    """(N,) who is within reach, with no other body on the line from the robot to the centre."""
    place_m = people_m - robot_m
    away_m = np.hypot(*place_m.T)
    seen = away_m < REACH_M
    for person in np.flatnonzero(seen):
        ahead = place_m[person] / away_m[person]
        along_m, aside_m = place_m @ ahead, np.abs(place_m @ np.array([-ahead[1], ahead[0]]))
        hides = (along_m > 0) & (along_m < away_m[person]) & (aside_m < BODY_M)
        hides[person] = False
        seen[person] = not hides.any()
    return seen


class Sightings:
    """Errors of the tracks of people in sight; how many have none, and how many are nobody."""

    def __init__(self) -> None:
        self.errors_m: list[float] = []
        self.errors_mps: list[float] = []
        self.n_missed = self.n_tracks = self.n_nobody = 0

    def compare(self, robot_m: FloatArray, true: People, tracked: People) -> None:
        """Take the people and the tracks at one time."""
        away_m = np.linalg.norm(true.position_m[:, None] - tracked.position_m[None], axis=2)
        for person in np.flatnonzero(in_sight(robot_m, true.position_m)):
            if away_m[person].min(initial=np.inf) >= MATCH_M:
                self.n_missed += 1
                continue
            track = away_m[person].argmin()
            error_mps = true.velocity_mps[person] - tracked.velocity_mps[track]
            self.errors_m.append(float(away_m[person, track]))
            self.errors_mps.append(float(np.hypot(*error_mps)))
        near = np.hypot(*(tracked.position_m - robot_m).T) < REACH_M
        self.n_tracks += int(near.sum())
        self.n_nobody += int((away_m.min(axis=0, initial=np.inf)[near] >= MATCH_M).sum())

    @property
    def missed_share(self) -> float:
        """Share of the people in sight without a track."""
        return self.n_missed / max(self.n_missed + len(self.errors_m), 1)

    @property
    def nobody_share(self) -> float:
        """Share of the tracks within reach that are nobody."""
        return self.n_nobody / max(self.n_tracks, 1)


def _measured(case: Mapping[str, float]) -> dict[str, Any]:
    sightings = Sightings()
    for seed in SEEDS:
        _drive(case, seed, sightings)
    return {
        "sightings": len(sightings.errors_m),
        "error_m": round(float(np.median(sightings.errors_m)), 3),
        "error_m_95": round(float(np.quantile(sightings.errors_m, 0.95)), 3),
        "error_mps": round(float(np.median(sightings.errors_mps)), 2),
        "error_mps_95": round(float(np.quantile(sightings.errors_mps, 0.95)), 2),
        "missed": round(sightings.missed_share, 3),
        "nobody": round(sightings.nobody_share, 3),
    }


def _drive(case: Mapping[str, float], seed: int, sightings: Sightings) -> None:
    scenario = load_scenario("hallway").with_pedestrian_count(int(case["people"]))
    scenario = scenario.with_values("lidar", noise_deviation_m=NOISE_M)
    rng = np.random.default_rng(seed)
    lidar, limits = scenario.lidar, GuardSettings.of_scenario(scenario, "scan")
    geometry = ScanGeometry(
        lidar.angle_min_rad, lidar.angle_increment_rad, lidar.range_min_m, lidar.range_max_m
    )
    tracker = LidarPeople(scenario, limits, case["wall_margin"])
    deviations = np.array([case["pose_m"], case["pose_m"], case["pose_rad"]])
    begin_s: float | None = None
    with HallwayWorld(scenario, seed=seed) as world:

        def observe(observation: Observation, _: Command, __: object) -> None:
            nonlocal begin_s
            time_s = observation.time_s
            begin_s = time_s if begin_s is None else begin_s
            if world.is_scan_tick:
                ranges_m = world.scan(observation)
                tracker.take_scan(Scan(time_s, ranges_m, geometry, (0.0, 0.0, 0.0)))
            x_m, y_m, yaw_rad = np.array(observation.pose) + rng.normal(0.0, deviations)
            tracked = tracker.step(replace(observation, pose=(x_m, y_m, yaw_rad)))
            if time_s - begin_s > SETTLED_S and not isinstance(tracked, Fault):
                sightings.compare(np.array(observation.pose[:2]), observation.people, tracked)

        planner, driver = make_planner("dwa", scenario), ScriptedExpert(scenario, seed)
        run_episode(world, planner, driver, episode=0, observer=observe)
