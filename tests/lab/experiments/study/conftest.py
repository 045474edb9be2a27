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


def decisions_of(role, study):
    place = study.scenario
    found, _ = demonstrations_of_bag(
        BAGS / role, study.problem.grid, place.patience_s, place.wait_s
    )
    return found


@pytest.fixture(scope="session")
def shipped_sets(study):
    return DemonstrationSets(**{role: decisions_of(role, study) for role in ROLES})
