"""Baselines of a library: they drive to the waypoint and keep to the robot's limits."""

import sys

import pytest

from serd_core.errors import SerdError
from sim.episodes.batch import EpisodeTask, run_task
from sim.planning.catalogue import baseline_names, make_planner
from sim.scenario.scenario import load_scenario

TASK = EpisodeTask("social_v1/pedestrian_obstruction", 1, driver="expert_with_flow", guarded=0)


def row_of(planner):
    return run_task(EpisodeTask(TASK.scenario, TASK.seed, planner=planner, guarded=0))


@pytest.mark.parametrize("name", baseline_names())
def test_a_baseline_arrives_and_repeats_to_the_bit(name):
    row = row_of(name)
    assert row["outcome"] == "arrived"
    assert row == row_of(name)


@pytest.mark.parametrize("name", ["orca", "social_force"])
def test_it_drives_round_a_person_into_whom_a_robot_drives_that_ignores_people(name):
    assert row_of("straight")["robot_on_person"] > 0
    assert row_of(name)["robot_on_person"] == 0


def test_without_the_library_the_error_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "navground", None)
    with pytest.raises(SerdError, match=r"pip install 'serd\[baselines\]'"):
        make_planner("orca", load_scenario("hallway"))
