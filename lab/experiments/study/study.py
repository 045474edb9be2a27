"""A study: its settings, the folder of its stages, and the world that they describe."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.experiments.study.settings import StudySettings, WorldSettings
from serd_app.navigation.strategy import start_distribution
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.navigation import NavigationProblem
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import Scenario, load_scenario

TRAIN_AREA, TRANSFER_AREA = "train", "transfer"


def scenario_with(name: str, people: int, *, crowd: str, drive: str) -> Scenario:
    """A scenario with a number of people of a crowd model, and the drive of its robot."""
    place = load_scenario(name).with_values("robot", drive=drive)
    return place.with_values("pedestrians", count=people, model=crowd)


@dataclass(frozen=True)
class StudyWorld:
    """Where a study is recorded; folder: of its stages."""

    settings: WorldSettings
    folder: Path

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario with the robot and the people of the study."""
        settings = self.settings
        return scenario_with(
            settings.scenario, settings.people, crowd=settings.crowd, drive=settings.drive
        )

    @cached_property
    def problem(self) -> NavigationProblem:
        """The decision problem (section 5.1) on that scenario."""
        return navigation_problem_of(self.scenario, self.settings.discount)

    @cached_property
    def starts(self) -> FloatArray:
        """(S,) where episodes of the training task begin."""
        return start_distribution(self.scenario, TRAIN_AREA)

    def policy_of(self, greedy: IntArray) -> FloatArray:
        """(S, A) the policy that takes the actions (S,)."""
        return np.asarray(np.eye(self.problem.mdp.n_actions)[greedy])


@dataclass(frozen=True)
class Study(StudyWorld):
    """The hallway study; all its tasks get it."""

    settings: StudySettings
