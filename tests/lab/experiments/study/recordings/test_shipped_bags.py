"""The bags under bags/data hold what the study drives in process."""

import numpy as np
import pytest

from lab.experiments.study.recordings.demonstrations import ROLES, start_area_of
from lab.experiments.study.recordings.drives import drive_in, world_seed
from lab.experiments.study.recordings.experts import PEOPLE
from serd_sim.drivers.catalogue import make_driver


@pytest.mark.parametrize("role", ROLES)
def test_every_bag_holds_the_episodes_the_study_asks_for(role, study, shipped):
    _, report = shipped(role)
    assert report.n_episodes == getattr(study.settings.demonstrations, role)
    assert not report.dropped


@pytest.mark.parametrize("role", ["training", "transfer"])
def test_a_bag_recorded_through_ros_equals_the_drive_in_process(role, study, shipped):
    (recorded, _), settings = shipped(role), study.settings
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
    # Both are counted from other beginnings, so that times differ by rounding.
    tolerances = dict.fromkeys(("state", "action", "next_state", "censored"), 0.0)
    for column, atol in (tolerances | {"time_s": 1e-12, "dwell_s": 1e-12}).items():
        one, other = getattr(driven, column), getattr(first, column)
        np.testing.assert_allclose(one, other, rtol=0, atol=atol)
