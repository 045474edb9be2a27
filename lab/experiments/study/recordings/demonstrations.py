"""Demonstrations: for every expert and repetition, a training, a test and a transfer set.

The scripted people ("people") drive in several styles; planned experts know or err about the crowd.
Every repetition is recorded anew in worlds of its own. The bags under bags/data hold
repetition 0 of the scripted people, driven with the guard.

Bags, where people drove, may take the place of the scripted people. Their episodes are split at
random, anew in every repetition; those that begin in the transfer area are the transfer set.
Repetitions then share the same episodes, so intervals over them show how much the split matters,
not how much other people would differ.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from lab.experiments.study.products import Task, load_recorded, save_recorded
from lab.experiments.study.recordings.drives import Purpose, drive_in, world_seed
from lab.experiments.study.recordings.experts import EXPERTS, PEOPLE, planned_policy
from lab.experiments.study.recordings.reference import reference_dynamics
from lab.experiments.study.study import TRAIN_AREA, TRANSFER_AREA, StudyWorld
from serd_app.demonstrations.decision_table import (
    concatenate_renumbered,
)
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_app.demonstrations.discretise import OFF_GRID, DiscretisationReport
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import explained
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.errors import SerdError
from serd_sim.drivers.catalogue import Driver, make_driver
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.scenario.grid import start_states_of

ROLES = {"training": Purpose.TRAINING, "test": Purpose.TEST, "transfer": Purpose.TRANSFER}
#: Share of decisions outside the cells above which a bag is taken for that of another place.
_MOST_OUTSIDE = 0.5


@dataclass(frozen=True, eq=False)
class DemonstrationSets:
    """Decisions of each set."""

    training: Decisions
    test: Decisions
    transfer: Decisions


def demonstration_tasks(
    study: StudyWorld, experts: Sequence[str] = EXPERTS, roles: Collection[str] = ROLES.keys()
) -> tuple[Task, ...]:
    """One table per expert, repetition and set."""
    return tuple(
        Task(
            _file(study, expert, repetition, role),
            partial(record_set, study, expert, repetition, role),
        )
        for expert, repetition in study.settings.repetitions_of(experts)
        for role in roles
    )


def load_sets(study: StudyWorld, expert: str, repetition: int) -> DemonstrationSets:
    """The recorded sets of one repetition."""
    return DemonstrationSets(**{role: load_set(study, expert, repetition, role) for role in ROLES})


def load_set(study: StudyWorld, expert: str, repetition: int, role: str) -> Decisions:
    """One recorded set of one repetition."""
    return load_recorded(_file(study, expert, repetition, role))


def start_area_of(role: str) -> str:
    """Where the episodes of a set begin."""
    return TRANSFER_AREA if role == "transfer" else TRAIN_AREA


def record_set(study: StudyWorld, expert: str, repetition: int, role: str, file: Path) -> None:
    """Drive one set and write its table; or take it from bags, where people drove."""
    settings = study.settings
    if expert == PEOPLE and settings.demonstrations.bags:
        save_recorded(file, getattr(sets_from_bags(study, repetition), role))
        return
    seed = world_seed(settings.seed, expert, repetition, ROLES[role])
    n_episodes = getattr(settings.demonstrations, role)
    drives = drive_in(
        study.scenario,
        study.problem,
        settings.planner,
        _driver(study, expert, seed),
        seed=seed,
        starts=[(episode, start_area_of(role)) for episode in range(n_episodes)],
    )
    save_recorded(file, drives.decisions)


def sets_from_bags(study: StudyWorld, repetition: int) -> DemonstrationSets:
    """The sets of one repetition; SerdError where the bags hold too few episodes."""
    decisions, wanted = _decisions_of_bags(study), study.settings.demonstrations
    pieces = trajectories_of(decisions)
    begins = pieces.start[np.unique(pieces.episode, return_index=True)[1]]
    transfer_states = start_states_of(study.scenario, study.problem.grid, TRANSFER_AREA)
    elsewhere = np.isin(begins, transfer_states)
    rng = np.random.default_rng([study.settings.seed, repetition])
    usual = rng.permutation(decisions.episodes[~elsewhere])
    transfer = rng.permutation(decisions.episodes[elsewhere])
    _require("training and test", len(usual), wanted.training + wanted.test)
    _require("transfer", len(transfer), wanted.transfer)
    return DemonstrationSets(
        training=decisions.select_episodes(usual[: wanted.training]),
        test=decisions.select_episodes(usual[wanted.training :][: wanted.test]),
        transfer=decisions.select_episodes(transfer[: wanted.transfer]),
    )


def check_bags(study: StudyWorld) -> None:
    """Read the bags, if any, before hours are spent; SerdError where they cannot make the sets."""
    if study.settings.demonstrations.bags:
        sets_from_bags(study, 0)


def _file(study: StudyWorld, expert: str, repetition: int, role: str) -> Path:
    return study.folder / "demonstrations" / expert / f"{role}_{repetition:02d}.csv"


def _driver(study: StudyWorld, expert: str, seed: int) -> Driver:
    settings, problem = study.settings, study.problem
    if expert == PEOPLE:
        return make_driver(settings.demonstrations.driver, study.scenario, seed)
    truth = reference_dynamics(study)
    policy = planned_policy(problem, expert, settings.planned_weights, truth)
    return PolicyDriver(problem.grid, policy, seed=seed, greedy=False, name=expert)


def _decisions_of_bags(study: StudyWorld) -> Decisions:
    tables = []
    seen: set[bytes] = set()  # an episode of two bags would be learned from and tested on
    for bag in study.settings.demonstrations.bags:
        found, report = demonstrations_of_bag(
            Path(bag), study.problem.grid, study.scenario.decision_period_s, seen=seen
        )
        _require_same_place(bag, report, study.scenario.name)
        tables.append(found.decisions)
    every = concatenate_renumbered(tables)
    return every.select(explained(study.problem.mdp, every))


def _require_same_place(bag: str, report: DiscretisationReport, scenario: str) -> None:
    outside = report.dropped.get(OFF_GRID, 0)
    if outside > _MOST_OUTSIDE * report.n_intents:
        raise SerdError(
            f"bag {bag} must be recorded in the scenario {scenario!r}, but {outside} of"
            f" {report.n_intents} decisions lie outside its cells; name the place it was recorded"
            " in as scenario in a --config file"
        )


def _require(name: str, found: int, wanted: int) -> None:
    if found < wanted:
        raise SerdError(
            f"the bags must hold {wanted} episodes for {name}, got {found}"
            "; record more, or lower demonstrations in a --config file"
        )
