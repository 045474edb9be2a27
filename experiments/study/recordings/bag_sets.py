"""Demonstrations out of bags, where people drove: split at random, anew in every repetition.

Episodes that begin in the transfer area are the transfer set. Repetitions share the same episodes,
so intervals over them tell how much the split matters, not how much other people would differ.
"""

from pathlib import Path

import numpy as np

from experiments.study.recordings.demonstration_sets import DemonstrationSets
from experiments.study.settings import StudySettings
from experiments.study.world import TRANSFER_AREA, problem_of, scenario_of
from serd_app.demonstrations.concatenate import concatenate_renumbered
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_app.demonstrations.discretise import OFF_GRID, DiscretisationReport
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.observations import explained
from serd_core.demonstrations.trajectories import trajectories_of
from serd_core.errors import SerdError
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.grid import start_states_of
from sim.scenario.scenario import Scenario

#: Share of decisions outside the cells above which a bag is taken for that of another place.
_MOST_OUTSIDE = 0.5


def sets_from_bags(
    settings: StudySettings, scenario: Scenario, problem: NavigationProblem, repetition: int
) -> DemonstrationSets:
    """The sets of one repetition; SerdError where the bags hold too few episodes."""
    decisions = _decisions(settings, scenario, problem)
    pieces = trajectories_of(decisions)
    begins = pieces.start[np.unique(pieces.episode, return_index=True)[1]]
    elsewhere = np.isin(begins, start_states_of(scenario, problem.grid, TRANSFER_AREA))
    rng = np.random.default_rng([settings.seed, repetition])
    usual = rng.permutation(decisions.episodes[~elsewhere])
    transfer = rng.permutation(decisions.episodes[elsewhere])
    wanted = settings.demonstrations
    _require("training and test", len(usual), wanted.training + wanted.test)
    _require("transfer", len(transfer), wanted.transfer)
    return DemonstrationSets(
        training=decisions.select_episodes(usual[: wanted.training]),
        test=decisions.select_episodes(usual[wanted.training :][: wanted.test]),
        transfer=decisions.select_episodes(transfer[: wanted.transfer]),
    )


def check_bags(settings: StudySettings) -> None:
    """Read the bags, if any, before hours are spent; SerdError where they cannot make the sets."""
    if settings.demonstrations.bags:
        sets_from_bags(settings, scenario_of(settings), problem_of(settings), 0)


def _decisions(
    settings: StudySettings, scenario: Scenario, problem: NavigationProblem
) -> Decisions:
    tables = []
    seen: set[bytes] = set()  # an episode of two bags would be learned from and tested on
    for bag in settings.demonstrations.bags:
        found, report = demonstrations_of_bag(
            Path(bag), problem.grid, scenario.decision_period_s, seen=seen
        )
        decisions = found.decisions
        _require_same_place(bag, report, scenario.name)
        tables.append(decisions)
    every = concatenate_renumbered(tables)
    return every.select(explained(problem.mdp, every))


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
