from pathlib import Path

import pytest

from lab.experiments.study.recordings.demonstrations import ROLES, sets_from_bags
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_app.demonstrations.demonstrations import demonstrations_of_bag

SETTINGS = study_settings()
BAGS = Path(__file__).parents[4] / "bags" / "data" / "hallway"


@pytest.fixture(scope="session")
def settings():
    return SETTINGS


@pytest.fixture(scope="session")
def study():
    return Study(SETTINGS, Path())


@pytest.fixture(scope="session")
def scenario(study):
    return study.scenario


@pytest.fixture(scope="session")
def problem(study):
    return study.problem


@pytest.fixture(scope="session")
def shipped_training(scenario, problem):
    return demonstrations_of_bag(BAGS / "training", problem.grid, scenario.decision_period_s)[
        0
    ].decisions


@pytest.fixture(scope="session")
def shipped_sets():
    with_bags = study_settings(bags=[BAGS / role for role in ROLES])
    return sets_from_bags(Study(with_bags, Path()), repetition=0)


@pytest.fixture(scope="session")
def bags_folder():
    return BAGS
