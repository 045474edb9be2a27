"""Demonstrations: for every expert and repetition, a training, a test and a transfer set.

The scripted people ("people") drive in several styles; planned experts know or err about the crowd.
Every repetition is recorded anew in worlds of its own. The bags under bags/data hold
repetition 0 of the scripted people, driven with the guard.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lab.experiments.study.products import Task
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE, planned_policy
from lab.experiments.study.recordings.reference import reference_dynamics
from lab.experiments.study.study import TRAIN_AREA, TRANSFER_AREA, Study
from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_core.demonstrations.decisions import Decisions
from serd_sim.drivers.catalogue import Driver, make_driver
from serd_sim.drivers.policy_driver import PolicyDriver

ROLES = {"training": Purpose.TRAINING, "test": Purpose.TEST, "transfer": Purpose.TRANSFER}


@dataclass(frozen=True, eq=False)
class DemonstrationSets:
    """Decisions of each set."""

    training: Decisions
    test: Decisions
    transfer: Decisions


def demonstration_tasks(study: Study) -> tuple[Task, ...]:
    """One table per expert, repetition and set."""
    return tuple(
        Task(
            _file(study, expert, repetition, role),
            partial(record_set, study, expert, repetition, role),
        )
        for expert, repetition in study.settings.repetitions_of(EXPERTS)
        for role in ROLES
    )


def load_sets(study: Study, expert: str, repetition: int) -> DemonstrationSets:
    """The recorded sets of one repetition."""
    files = {role: _file(study, expert, repetition, role) for role in ROLES}
    return DemonstrationSets(**{role: load_decisions(file) for role, file in files.items()})


def start_area_of(role: str) -> str:
    """Where the episodes of a set begin."""
    return TRANSFER_AREA if role == "transfer" else TRAIN_AREA


def record_set(study: Study, expert: str, repetition: int, role: str, file: Path) -> None:
    """Drive one set and write its table."""
    settings = study.settings
    seed = world_seed(settings.seed, expert, repetition, ROLES[role])
    n_episodes = getattr(settings.demonstrations, role)
    drives = drive_in(
        study.scenario,
        study.problem,
        _driver(study, expert, seed),
        seed=seed,
        starts=[(episode, start_area_of(role)) for episode in range(n_episodes)],
    )
    save_decisions(file, drives.decisions)


def _file(study: Study, expert: str, repetition: int, role: str) -> Path:
    return study.folder / "demonstrations" / expert / f"{role}_{repetition:02d}.csv"


def _driver(study: Study, expert: str, seed: int) -> Driver:
    settings, problem = study.settings, study.problem
    if expert == PEOPLE:
        return make_driver(settings.demonstrations.driver, study.scenario, seed)
    truth = reference_dynamics(study)
    policy = planned_policy(problem, expert, settings.beliefs.reward_weights, truth)
    return PolicyDriver(problem.grid, policy, seed=seed, greedy=False, name=expert)
