"""Demonstrations: for every expert and repetition, a training, a test and a transfer set.

The scripted people ("people") drive in several styles; planned experts know or err about the crowd.
Every repetition is recorded anew in worlds of its own. Repetition 0 of the scripted people is what
the bags under bags/data hold.
"""

from functools import partial
from pathlib import Path

from experiments.study.products import Task
from experiments.study.recordings.bag_sets import sets_from_bags
from experiments.study.recordings.demonstration_sets import ROLES, DemonstrationSets
from experiments.study.recordings.drives import drive_episodes
from experiments.study.recordings.experts import PEOPLE, planned_policy
from experiments.study.recordings.reference import reference_dynamics
from experiments.study.recordings.seeds import world_seed
from experiments.study.settings import StudySettings
from experiments.study.world import TRAIN_AREA, TRANSFER_AREA, problem_of, scenario_of
from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_core.grid.navigation import NavigationProblem
from sim.drivers.catalogue import Driver, make_driver
from sim.drivers.policy_driver import PolicyDriver
from sim.scenario.scenario import Scenario


def n_repetitions(settings: StudySettings, expert: str) -> int:
    """How often an expert's demonstrations are recorded anew."""
    return (settings.learning if expert == PEOPLE else settings.beliefs).repetitions


def demonstration_tasks(
    settings: StudySettings, expert: str, folder: Path, reference: Path
) -> tuple[Task, ...]:
    """One table per repetition and set."""
    return tuple(
        Task(
            set_file(folder, expert, repetition, role),
            partial(record_set, settings, expert, repetition, role, reference),
        )
        for repetition in range(n_repetitions(settings, expert))
        for role in ROLES
    )


def set_file(folder: Path, expert: str, repetition: int, role: str) -> Path:
    """Where a set is kept."""
    return folder / expert / f"{role}_{repetition:02d}.csv"


def load_sets(folder: Path, expert: str, repetition: int) -> DemonstrationSets:
    """The recorded sets of one repetition."""
    return DemonstrationSets(
        **{role: load_decisions(set_file(folder, expert, repetition, role)) for role in ROLES}
    )


def start_area_of(role: str) -> str:
    """Where the episodes of a set begin."""
    return TRANSFER_AREA if role == "transfer" else TRAIN_AREA


def record_set(
    settings: StudySettings, expert: str, repetition: int, role: str, reference: Path, file: Path
) -> None:
    """Drive one set and write its table; or take it from bags, where people drove."""
    scenario, problem = scenario_of(settings), problem_of(settings)
    if expert == PEOPLE and settings.demonstrations.bags:
        recorded = sets_from_bags(settings, scenario, problem, repetition)
        save_decisions(file, getattr(recorded, role))
        return
    seed = world_seed(settings.seed, expert, repetition, ROLES[role])
    drives = drive_episodes(
        scenario,
        problem,
        _driver(settings, scenario, problem, expert, seed, reference),
        planner=settings.planner,
        seed=seed,
        episodes=range(getattr(settings.demonstrations, role)),
        start_area=start_area_of(role),
    )
    save_decisions(file, drives.decisions)


def _driver(
    settings: StudySettings,
    scenario: Scenario,
    problem: NavigationProblem,
    expert: str,
    seed: int,
    reference: Path,
) -> Driver:
    if expert == PEOPLE:
        return make_driver(settings.demonstrations.driver, scenario, seed)
    truth = reference_dynamics(problem, reference)
    policy = planned_policy(problem, expert, settings.beliefs.reward_weights, truth)
    return PolicyDriver(problem.grid, policy, seed=seed, greedy=False, name=expert)
