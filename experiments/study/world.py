"""The world of the study: its scenario with its people, and the decision problem on it."""

import numpy as np

from experiments.study.settings import StudySettings
from serd_core.arrays import FloatArray
from serd_core.grid.navigation import NavigationProblem
from sim.scenario.grid import navigation_problem_of, start_states_of
from sim.scenario.scenario import Scenario, load_scenario

TRAIN_AREA, TRANSFER_AREA = "train", "transfer"


def scenario_of(settings: StudySettings) -> Scenario:
    """The scenario with the number of people of the study."""
    return load_scenario(settings.scenario).with_pedestrian_count(settings.people)


def problem_of(settings: StudySettings) -> NavigationProblem:
    """Section 5.1 on that scenario."""
    return navigation_problem_of(scenario_of(settings), settings.discount)


def start_shares(scenario: Scenario, problem: NavigationProblem, area: str) -> FloatArray:
    """(S,) uniform over the cells of a start area in which the robot starts."""
    states = start_states_of(scenario, problem.grid, area)
    share = np.zeros(problem.grid.n_states)
    share[states] = 1.0 / len(states)
    return share
