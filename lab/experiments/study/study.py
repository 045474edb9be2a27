"""A study: its settings, the folder of its stages, and the world that they describe."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lab.experiments.study.settings import StudySettings
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.navigation import NavigationProblem, with_dwell_times
from serd_core.semi_markov.models import require_timed
from serd_sim.drivers.strategy import start_distribution
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import Scenario, load_scenario

TRAIN_AREA, TRANSFER_AREA = "train", "transfer"


@dataclass(frozen=True)
class Study:
    """The hallway study; all its tasks get it. folder: of its stages."""

    settings: StudySettings
    folder: Path

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario with the robot and the people of the study."""
        settings = self.settings
        place = load_scenario(settings.scenario).with_values("robot", drive=settings.drive)
        return place.with_values("pedestrians", count=settings.people, model=settings.crowd)

    @cached_property
    def problem(self) -> NavigationProblem:
        """The decision problem (section 5.1) on that scenario."""
        return navigation_problem_of(self.scenario, self.settings.discount)

    @cached_property
    def timed(self) -> NavigationProblem:
        """The same problem with decisions that take time."""
        place = self.scenario
        return with_dwell_times(self.problem, patience_s=place.patience_s, wait_s=place.wait_s)

    def laws_of(self, decisions: Decisions) -> FloatArray:
        """Parameters of the laws of dwell times that are counted in `TimedDecisions`."""
        laws = require_timed(self.timed.mdp.transitions).means.start
        return estimate_dynamics(self.timed, decisions)[laws:]

    @cached_property
    def starts(self) -> FloatArray:
        """(S,) where episodes of the training task begin."""
        return start_distribution(self.scenario, TRAIN_AREA)

    def policy_of(self, greedy: IntArray) -> FloatArray:
        """(S, A) the policy that takes the actions (S,)."""
        return np.asarray(np.eye(self.problem.mdp.n_actions)[greedy])
