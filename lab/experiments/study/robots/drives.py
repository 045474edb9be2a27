"""The drives: every robot of a repetition in both tasks, in the same worlds."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lab.experiments.running.tables import Row
from lab.experiments.study.products import load_part
from lab.experiments.study.recordings.drives import drive_in
from lab.experiments.study.robots.settings import TASKS, RobotsStudy
from serd_core.grid.grid import Action
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint


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
    problem = navigation_problem_of(scenario, study.settings.discount)
    seed, grid = study.seed_of(place, repetition) + 1, problem.grid
    table = np.full((grid.n_states, len(Action)), 1.0 / len(Action)) if policy is None else policy
    drives = drive_in(
        scenario,
        problem,
        PolicyDriver(grid, table, seed=seed),
        seed=seed,
        starts=enumerate(np.repeat(TASKS, n).tolist()),
        planner=GoalPlanner(scenario) if policy is None else None,
    )
    return [
        {
            "place": place,
            "repetition": repetition,
            "task": record.start_area,
            "episode": record.episode,
            "arrived": record.outcome == "arrived",
            "seconds": record.duration_s,
            "contacts": record.contacts.robot_on_person,
        }
        for record in drives.records
    ]
