"""The drives: every robot of a repetition in both tasks, in the same worlds."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.robots.settings import TASKS, RobotsStudy
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import LocalPlanner, make_planner
from serd_sim.safety.world_guard import no_guard
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld


class GoalPlanner:
    """The local planner of a scenario, which drives to the middle of the goal whatever it is told.

    Implements `LocalPlanner`.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._planner = make_planner(scenario)
        self._goal = Waypoint(*np.mean(scenario.goal_area_m, axis=0).tolist())

    @property
    def is_blocked(self) -> bool:
        """Whether it stands because of what is around it."""
        return self._planner.is_blocked

    def reset(self) -> None:
        """Forget the last episode."""
        self._planner.reset()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The command towards the goal."""
        del waypoint
        return self._planner.step(observation, self._goal)


def drive_repetition(study: RobotsStudy, place: str, repetition: int) -> dict[str, Any]:
    """rows: one per robot, task and drive, with seconds cut off at the time limit.

    Equal policies drive alike in equal worlds, so each drives once.
    """
    robots: Mapping[str, Any] = load_part(study, "learning", place, repetition)["robots"]
    driven = dict[str, list[Row]]()
    rows: list[Row] = []
    for name, robot in robots.items():
        kind = str(robot["policy"])
        if kind not in driven:
            driven[kind] = _drive(study, place, repetition, robot["policy"])
        rows += [{"robot": name} | row for row in driven[kind]]
    return {"rows": rows}


def _drive(
    study: RobotsStudy, place: str, repetition: int, policy: list[list[float]] | None
) -> list[Row]:
    scenario, n = study.scenarios[place], study.settings.places[place].drives
    seed, grid = study.seed_of(place, repetition) + 1, grid_of(scenario)
    table = np.full((grid.n_states, 5), 0.2) if policy is None else np.array(policy)
    driver = PolicyDriver(grid, table, seed=seed)
    planner: LocalPlanner = GoalPlanner(scenario) if policy is None else make_planner(scenario)
    rows = []
    with HallwayWorld(scenario, seed=seed) as world:
        for episode, task in enumerate(np.repeat(TASKS, n).tolist()):
            record = run_episode(
                world, planner, driver, episode=episode, start_area=task, guard=no_guard
            )
            row = {"place": place, "repetition": repetition, "task": task, "episode": episode}
            row |= {"arrived": record.outcome == "arrived", "seconds": record.duration_s}
            rows.append(row | {"contacts": record.contacts.robot_on_person})
    return rows
