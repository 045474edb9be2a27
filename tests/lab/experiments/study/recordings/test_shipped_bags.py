"""The bags under bags/data hold what the study drives in process."""

from pathlib import Path

import numpy as np
import pytest

from lab.experiments.study.recordings.demonstrations import ROLES, start_area_of
from lab.experiments.study.recordings.drives import drive_in, world_seed
from lab.experiments.study.recordings.experts import PEOPLE
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_sim.drivers.catalogue import make_driver

BAGS = Path(__file__).parents[5] / "bags" / "data" / "hallway"


def shipped(role, study):
    grid, place = study.problem.grid, study.scenario
    found, report = demonstrations_of_bag(BAGS / role, grid, place.patience_s, place.wait_s)
    return found, report


@pytest.mark.parametrize("role", ROLES)
def test_every_bag_holds_the_episodes_the_study_asks_for(role, study):
    _, report = shipped(role, study)
    assert report.n_episodes == getattr(study.settings.demonstrations, role)
    assert not report.dropped


@pytest.mark.parametrize("role", ["training", "transfer"])
def test_a_bag_recorded_through_ros_equals_the_drive_in_process(role, study):
    recorded, _ = shipped(role, study)
    settings = study.settings
    seed = world_seed(settings.seed, PEOPLE, 0, ROLES[role])
    driven = drive_in(
        study.scenario,
        study.problem,
        make_driver(settings.demonstrations.driver, study.scenario, seed),
        seed=seed,
        starts=[(0, start_area_of(role))],
        guard=None,  # the guard of the world, which the stack has and the study has not
    ).decisions
    first = recorded.select_episodes([0])
    for column in ("state", "action", "next_state", "censored"):
        np.testing.assert_array_equal(getattr(driven, column), getattr(first, column))
    # Both are counted from other beginnings, so that times differ by rounding.
    for column in ("time_s", "dwell_s"):
        np.testing.assert_allclose(
            getattr(driven, column), getattr(first, column), rtol=0, atol=1e-12
        )
