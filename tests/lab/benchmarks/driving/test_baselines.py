"""Baselines of a library: they drive to the waypoint and keep to the robot's limits."""

import sys

import pytest

from lab.benchmarks.driving.baselines import (
    BASELINE_COLUMNS,
    BASELINE_KEY,
    BASELINES,
    BaselinePlanner,
    BaselineTask,
    run_baseline,
)
from serd_files.errors import USER_ERRORS
from serd_sim.episodes.batch import run_batch
from serd_sim.episodes.execution import Execution
from serd_sim.scenario.scenario import load_scenario

SCENARIO = "social_v1/pedestrian_obstruction"


def row_of(planner):
    return run_baseline(BaselineTask(SCENARIO, 1, guarded=0, baseline=planner))


@pytest.mark.parametrize("name", BASELINES)
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
    with pytest.raises(USER_ERRORS, match="pip install navground"):
        BaselinePlanner("orca", load_scenario("hallway"))


def test_rows_of_baselines_are_kept_in_a_table_of_their_own(tmp_path):
    tasks = [BaselineTask(SCENARIO, 1, guarded=0, baseline=name) for name in ("orca", "straight")]
    table = tmp_path / "rows.csv"
    kinds = {"run": run_baseline, "columns": BASELINE_COLUMNS, "key_columns": BASELINE_KEY}
    rows = run_batch(tasks, table, **kinds, execution=Execution(1))
    assert [row["baseline"] for row in rows] == ["orca", "straight"]
    assert run_batch(tasks, table, **kinds, execution=Execution(1)) == rows
