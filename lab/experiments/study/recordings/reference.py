"""Reference recordings, and the dynamics estimated from them, which the study takes as true.

Experts of all styles, experts who go against the flow, and a robot that explores every direction.
No learner uses these recordings; the expert who knows the crowd plans with their estimate.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from lab.experiments.study.products import Task
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.study import TRAIN_AREA, TRANSFER_AREA, Study
from serd_app.demonstrations.decision_table import (
    concatenate,
    concatenate_renumbered,
    load_decisions,
    save_decisions,
)
from serd_app.report.summary import decisions_per_model
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Action, Grid, Outcome
from serd_sim.drivers.catalogue import Driver, make_driver
from serd_sim.world.observation import POLICY, Observation, episode_rng

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

    def decide(self, _observation: Observation, state: int) -> Action:
        """The direction it has, or a new one."""
        neighbours = self._grid.neighbours[state]
        if self._rng.random() < _CHANGES_MIND or neighbours[self._action] == state:
            waits = self._rng.random() < _WAITS
            free = np.flatnonzero(neighbours != state)
            self._action = Action.WAIT if waits else Action(int(self._rng.choice(free)))
        return self._action


def reference_tasks(study: Study) -> tuple[Task, ...]:
    """One table per kind and ten episodes; every second ten start where the transfer task does."""
    tasks = []
    for kind in _PURPOSES:
        count = getattr(study.settings.reference, kind)
        for first in range(0, count, _CHUNK):
            make = partial(record_reference, study, kind, first, min(first + _CHUNK, count))
            tasks.append(Task(study.folder / "reference" / f"{kind}_{first:03d}.csv", make))
    return tuple(tasks)


def record_reference(study: Study, kind: str, first: int, last: int, file: Path) -> None:
    """Write the table of some episodes of one kind."""
    seed = world_seed(study.settings.seed, PEOPLE, 0, _PURPOSES[kind])
    driver = _driver(study, kind, seed)
    timeout_s = study.settings.reference.exploring_s if kind == "exploring" else None
    drives = [
        drive_in(
            study.scenario,
            study.problem,
            driver,
            seed=seed,
            starts=[(episode, (TRAIN_AREA, TRANSFER_AREA)[episode % 2])],
            timeout_s=timeout_s,
        )
        for episode in range(first, last)
    ]
    save_decisions(file, concatenate(tuple(each.decisions for each in drives)))


def reference_decisions(study: Study) -> Decisions:
    """All reference recordings."""
    files = sorted((study.folder / "reference").glob("*.csv"))
    return concatenate_renumbered(tuple(load_decisions(file) for file in files))


def reference_dynamics(study: Study) -> FloatArray:
    """(M, K) outcome probabilities that the study takes as true."""
    return estimate_dynamics(study.problem, reference_decisions(study))


def reference_table(study: Study) -> pd.DataFrame:
    """The reference dynamics: probability of every outcome, and the number of decisions."""
    decisions = reference_decisions(study)
    names = [outcome.name.lower() for outcome in Outcome]
    table = pd.DataFrame(estimate_dynamics(study.problem, decisions), columns=names)
    table.insert(0, "model", study.problem.model_names)
    table.insert(1, "decisions", decisions_per_model(study.problem, decisions))
    return table


def _driver(study: Study, kind: str, seed: int) -> Driver:
    if kind == "exploring":
        return ExploringDriver(study.problem.grid, seed)
    driver = study.settings.demonstrations.driver
    name = "expert_against_flow" if kind == "against_flow" else driver
    return make_driver(name, study.scenario, seed)
