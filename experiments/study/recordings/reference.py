"""Reference recordings, and the dynamics estimated from them, which the study takes as true.

Experts of all styles, experts who go against the flow, and a robot that explores every direction.
No learner uses these recordings; the expert who knows the crowd plans with their estimate.
"""

from functools import partial
from pathlib import Path

import numpy as np

from experiments.study.products import Task
from experiments.study.recordings.drives import drive_episodes
from experiments.study.recordings.experts import PEOPLE
from experiments.study.recordings.seeds import Purpose, world_seed
from experiments.study.settings import StudySettings
from experiments.study.world import TRAIN_AREA, TRANSFER_AREA, problem_of, scenario_of
from serd_app.demonstrations.concatenate import concatenate
from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NavigationProblem
from sim.drivers.catalogue import Driver, make_driver
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from sim.world.seeds import POLICY, episode_rng

_CHUNK = 10
_CHANGES_MIND, _WAITS = 0.35, 0.1
_PURPOSES = {
    "experts": Purpose.REFERENCE_EXPERTS,
    "against_flow": Purpose.REFERENCE_AGAINST_FLOW,
    "exploring": Purpose.REFERENCE_EXPLORING,
}


class ExploringDriver:
    """Explores with a seed: draws a new direction at random times, never one that a wall blocks."""

    def __init__(self, grid: Grid, seed: int) -> None:
        self._grid, self._seed = grid, seed
        self.begin(0)

    @property
    def name(self) -> str:
        """Name for tables."""
        return "exploring"

    def begin(self, episode: int) -> None:
        """Start the random numbers of this episode."""
        self._rng = episode_rng(self._seed, episode, POLICY)
        self._action = Action.WAIT

    def decide(self, observation: Observation) -> Action:
        """The direction it has, or a new one."""
        state = self._grid.state_at(observation.x_m, observation.y_m)
        neighbours = self._grid.neighbours[state]
        if self._rng.random() < _CHANGES_MIND or neighbours[self._action] == state:
            waits = self._rng.random() < _WAITS
            free = np.flatnonzero(neighbours != state)
            self._action = Action.WAIT if waits else Action(int(self._rng.choice(free)))
        return self._action


def reference_tasks(settings: StudySettings, folder: Path) -> tuple[Task, ...]:
    """One table per kind and ten episodes; every second ten start where the transfer task does."""
    tasks = []
    for kind in _PURPOSES:
        count = getattr(settings.reference, kind)
        for first in range(0, count, _CHUNK):
            last = min(first + _CHUNK, count)
            make = partial(record_reference, settings, kind, first, last)
            tasks.append(Task(folder / f"{kind}_{first:03d}.csv", make))
    return tuple(tasks)


def record_reference(settings: StudySettings, kind: str, first: int, last: int, file: Path) -> None:
    """Write the table of some episodes of one kind."""
    scenario, problem = scenario_of(settings), problem_of(settings)
    seed = world_seed(settings.seed, PEOPLE, 0, _PURPOSES[kind])
    driver = _driver(settings, scenario, problem, kind, seed)
    timeout_s = settings.reference.exploring_s if kind == "exploring" else None
    drives = [
        drive_episodes(
            scenario,
            problem,
            driver,
            planner=settings.planner,
            seed=seed,
            episodes=[episode],
            start_area=(TRAIN_AREA, TRANSFER_AREA)[episode % 2],
            timeout_s=timeout_s,
        )
        for episode in range(first, last)
    ]
    save_decisions(file, concatenate(tuple(each.decisions for each in drives)))


def reference_decisions(folder: Path) -> Decisions:
    """All reference recordings."""
    return concatenate(tuple(load_decisions(file) for file in sorted(folder.glob("*.csv"))))


def reference_dynamics(problem: NavigationProblem, folder: Path) -> FloatArray:
    """(M, K) outcome probabilities that the study takes as true."""
    return estimate_dynamics(problem, reference_decisions(folder))


def _driver(
    settings: StudySettings,
    scenario: Scenario,
    problem: NavigationProblem,
    kind: str,
    seed: int,
) -> Driver:
    if kind == "exploring":
        return ExploringDriver(problem.grid, seed)
    name = "expert_against_flow" if kind == "against_flow" else settings.demonstrations.driver
    return make_driver(name, scenario, seed)
