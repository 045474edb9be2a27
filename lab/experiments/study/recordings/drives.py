"""Episodes in process, with the decisions that a recording of them has.

The world is bit for bit the one that runs through ROS, and the same decision epochs are followed
there, so a seed gives the same decisions either way. Every recording has a world of its own, given
by one number, which makes the same recording through ROS: `serd launch demonstrate seed:=NUMBER
...`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from lab.experiments.study.recordings.experts import EXPERTS
from serd_app.demonstrations.decision_table import concatenate
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.demonstrations.observations import explained
from serd_core.grid.navigation import NavigationProblem
from serd_sim.drivers.catalogue import Driver
from serd_sim.episodes.episode import EpisodeRecord, run_episode
from serd_sim.planning.local_planner import LocalPlanner, make_planner
from serd_sim.safety.world_guard import CommandFilter, no_guard
from serd_sim.scenario.scenario import Scenario
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
    """decisions: of all episodes; records: one per episode, in order."""

    decisions: TimedDecisions
    records: tuple[EpisodeRecord, ...]


def drive_in(
    scenario: Scenario,
    problem: NavigationProblem,
    driver: Driver,
    *,
    seed: int,
    starts: Iterable[tuple[int, str]],
    timeout_s: float | None = None,
    guard: CommandFilter | None = no_guard,
    planner: LocalPlanner | None = None,
) -> Drives:
    """Run episodes one after the other in a world of that seed; starts: their numbers and areas.

    guard: of `run_episode`; the kept results were made without any. planner: the scenario's own
    where None.
    """
    local_planner = make_planner(scenario) if planner is None else planner
    with HallwayWorld(scenario, seed=seed) as world:
        records = tuple(
            run_episode(
                world,
                local_planner,
                driver,
                episode=episode,
                start_area=start_area,
                timeout_s=timeout_s,
                guard=guard,
            )
            for episode, start_area in starts
        )
    found = concatenate(tuple(each.decisions for each in records))
    return Drives(found.select(explained(problem.mdp, found)), records)
