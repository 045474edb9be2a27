from pathlib import Path

import pytest

from experiments.study.recordings.bag_sets import sets_from_bags
from experiments.study.recordings.demonstration_sets import ROLES
from experiments.study.settings import study_settings
from experiments.study.world import problem_of, scenario_of
from serd_app.demonstrations.demonstrations import demonstrations_of_bag

SETTINGS = study_settings()
BAGS = Path(__file__).parents[3] / "bags" / "data" / "hallway"


@pytest.fixture(scope="session")
def settings():
    return SETTINGS


@pytest.fixture(scope="session")
def scenario():
    return scenario_of(SETTINGS)


@pytest.fixture(scope="session")
def problem():
    return problem_of(SETTINGS)


@pytest.fixture(scope="session")
def shipped_training(scenario, problem):
    return demonstrations_of_bag(BAGS / "training", problem.grid, scenario.decision_period_s)[
        0
    ].decisions


@pytest.fixture(scope="session")
def shipped_sets(scenario, problem):
    with_bags = study_settings(bags=[BAGS / role for role in ROLES])
    return sets_from_bags(with_bags, scenario, problem, repetition=0)


@pytest.fixture(scope="session")
def bags_folder():
    return BAGS
