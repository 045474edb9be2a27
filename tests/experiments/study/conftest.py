from pathlib import Path

import pytest

from bags.discretise import decisions_from_bag
from experiments.study.settings import study_settings
from experiments.study.world import problem_of, scenario_of

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
    return decisions_from_bag(BAGS / "training", problem.grid, scenario.decision_period_s)[0]


@pytest.fixture(scope="session")
def bags_folder():
    return BAGS
