"""Episodes in process, turned into decisions by the same rule as recordings in bags.

The world is bit for bit the one that runs through ROS, and the poses and intents collected here go
through `serd_app.demonstrations.discretise`, so a seed gives the same decisions either way. Every
recording has a world of its own, given by one number, which makes the same recording through ROS:
`serd launch demonstrate seed:=NUMBER ...`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from lab.experiments.study.recordings.experts import EXPERTS
from serd_app.demonstrations.decision_table import concatenate
from serd_app.demonstrations.discretise import decisions_from_drive
from serd_app.drives.episode_spans import EpisodeSpan
from serd_app.drives.recorded_drive import RecordedDrive
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import explained
from serd_core.grid.grid import Action
from serd_core.grid.navigation import NavigationProblem
from serd_sim.drivers.catalogue import Driver
from serd_sim.episodes.episode import EpisodeRecord, run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.safety.world_guard import CommandFilter, no_guard
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import is_decision_tick
from serd_sim.world.world import HallwayWorld

_PER_EXPERT, _PER_REPETITION = 10_000, 10


class Purpose(IntEnum):
    """What a recording is for."""

    TRAINING = 0
    TEST = 1
    TRANSFER = 2
    MEASUREMENT = 3
    REFERENCE_EXPERTS = 5
    REFERENCE_AGAINST_FLOW = 6
    REFERENCE_EXPLORING = 7


def world_seed(seed: int, expert: str, repetition: int, purpose: Purpose) -> int:
    """Seed of the world (and of the driver) of one recording."""
    return seed + _PER_EXPERT * EXPERTS.index(expert) + _PER_REPETITION * repetition + int(purpose)


@dataclass(frozen=True, eq=False)
class Drives:
    """decisions: of all episodes; records: one per episode, in order.

    n_diagonal, n_far: moves that the decisions assign to a neighbour.
    """

    decisions: Decisions
    records: tuple[EpisodeRecord, ...]
    n_diagonal: int
    n_far: int


def drive_in(
    scenario: Scenario,
    problem: NavigationProblem,
    planner: str,
    driver: Driver,
    *,
    seed: int,
    starts: Iterable[tuple[int, str]],
    timeout_s: float | None = None,
    guard: CommandFilter | None = no_guard,
) -> Drives:
    """Run episodes one after the other in a world of that seed; starts: their numbers and areas.

    guard: of `run_episode`; the kept results were made without any.
    """
    local_planner = make_planner(planner, scenario)
    tables, records, reports = [], [], []
    with HallwayWorld(scenario, seed=seed) as world:
        for episode, start_area in starts:
            track = _Track(scenario)
            record = run_episode(
                world,
                local_planner,
                driver,
                episode=episode,
                start_area=start_area,
                timeout_s=timeout_s,
                observer=track.see,
                guard=guard,
            )
            drive = track.drive(record, world.observation)
            found, report = decisions_from_drive(drive, problem.grid, scenario.decision_period_s)
            tables.append(found.select(explained(problem.mdp, found)))
            records.append(record)
            reports.append(report)
    return Drives(
        concatenate(tuple(tables)),
        tuple(records),
        n_diagonal=sum(each.n_diagonal for each in reports),
        n_far=sum(each.n_far for each in reports),
    )


@dataclass(eq=False)
class _Track:
    """Poses at every tick and intents at every decision of one episode."""

    scenario: Scenario
    poses: list[tuple[float, float, float]] = field(default_factory=list)
    intents: list[tuple[float, int]] = field(default_factory=list)

    def see(self, observation: Observation, command: Command, action: Action) -> None:
        del command
        self.poses.append((observation.time_s, observation.x_m, observation.y_m))
        if is_decision_tick(observation, self.scenario):
            self.intents.append((observation.time_s, int(action)))

    def drive(self, record: EpisodeRecord, last: Observation) -> RecordedDrive:
        """The episode as a recording of it would be read."""
        pose = np.array([*self.poses, (last.time_s, last.x_m, last.y_m)])
        intent = np.array(self.intents).reshape(-1, 2)
        span = EpisodeSpan(record.episode, float(pose[0, 0]), float(pose[-1, 0]), record.outcome)
        return RecordedDrive(
            pose_time_s=pose[:, 0],
            position_m=pose[:, 1:],
            intent_time_s=intent[:, 0],
            intent_action=intent[:, 1].astype(np.int64),
            episodes=(span,),
            source=f"{record.driver} in {self.scenario.name}, seed {record.seed}",
        )
