from pathlib import Path

import pytest

from lab.experiments.study.recordings.demonstrations import ROLES, DemonstrationSets
from lab.experiments.study.settings import study_settings
from lab.experiments.study.study import Study
from serd_app.demonstrations.discretise import demonstrations_of_bag

SETTINGS = study_settings()
BAGS = Path(__file__).parents[4] / "bags" / "data" / "hallway"


@pytest.fixture(scope="session")
def settings():
    return SETTINGS


@pytest.fixture(scope="session")
def study():
    return Study(SETTINGS, Path())


@pytest.fixture(scope="session")
def problem(study):
    return study.problem


@pytest.fixture(scope="session")
def shipped(study):
    """Decisions of the bag of a role, and what was left out of them."""
    given = study.problem.grid, study.scenario.patience_s, study.scenario.wait_s
    return lambda role: demonstrations_of_bag(BAGS / role, *given)


@pytest.fixture(scope="session")
def shipped_sets(shipped):
    return DemonstrationSets(**{role: shipped(role)[0] for role in ROLES})
