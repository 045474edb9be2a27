"""The bags under bags/data hold what the study drives in process."""

from pathlib import Path

import numpy as np
import pytest

from experiments.study.recordings.demonstration_sets import ROLES
from experiments.study.recordings.demonstrations import start_area_of
from experiments.study.recordings.drives import drive_episodes
from experiments.study.recordings.experts import PEOPLE
from experiments.study.recordings.seeds import world_seed
from experiments.study.settings import study_settings
from experiments.study.world import problem_of, scenario_of
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from sim.drivers.catalogue import make_driver

BAGS = Path(__file__).parents[4] / "bags" / "data" / "hallway"
SETTINGS = study_settings()


@pytest.fixture(scope="module")
def problem():
    return problem_of(SETTINGS)


def shipped(role, problem):
    scenario = scenario_of(SETTINGS)
    found, report = demonstrations_of_bag(BAGS / role, problem.grid, scenario.decision_period_s)
    return found.decisions, report


@pytest.mark.parametrize("role", ROLES)
def test_every_bag_holds_the_episodes_the_study_asks_for(role, problem):
    _, report = shipped(role, problem)
    assert report.n_episodes == getattr(SETTINGS.demonstrations, role)
    assert not report.dropped


@pytest.mark.parametrize("role", ["training", "transfer"])
def test_a_bag_recorded_through_ros_equals_the_drive_in_process(role, problem):
    recorded, _ = shipped(role, problem)
    scenario = scenario_of(SETTINGS)
    seed = world_seed(SETTINGS.seed, PEOPLE, 0, ROLES[role])
    driven = drive_episodes(
        scenario,
        problem,
        make_driver(SETTINGS.demonstrations.driver, scenario, seed),
        planner=SETTINGS.planner,
        seed=seed,
        episodes=[0],
        start_area=start_area_of(role),
    ).decisions
    first = recorded.select_episodes([0])
    for column in ("time_s", "state", "action", "next_state"):
        np.testing.assert_array_equal(getattr(driven, column), getattr(first, column))
