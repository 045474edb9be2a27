"""The fault campaign: rows of single episodes, and their summary."""

import math
from dataclasses import replace

import pytest

from lab.command.faults import arrival_price, summarise_faults
from lab.faults.campaign import COLUMNS, run_fault, tasks_of
from serd_files.yaml_config import model_yaml
from serd_sim.episodes.batch import EpisodeTask
from serd_sim.scenario.scenario import load_scenario

CONDITION = EpisodeTask("hallway", 0, n_people=2)


def _row(fault, guarded, condition=CONDITION):
    return run_fault(tasks_of([fault], condition, [1])[guarded])


@pytest.mark.parametrize(("drive", "rocking_m"), [("kinematic", 1e-9), ("physical", 1e-3)])
def test_with_the_guard_the_robot_stands_after_the_scan_stops_and_without_it_drives_on(
    drive, rocking_m, tmp_path
):
    path = tmp_path / "hallway.yaml"
    path.write_text(model_yaml(load_scenario("hallway").with_values("robot", drive=drive)))
    condition = replace(CONDITION, scenario=str(path))
    guarded, unguarded = (_row("scan_stops", each, condition) for each in (1, 0))
    assert guarded["began"] == unguarded["began"] == 1
    assert guarded["zero_s"] <= 0.25
    assert guarded["stood_m"] < 0.6
    assert guarded["later_m"] == pytest.approx(0.0, abs=rocking_m)
    assert unguarded["way_m"] > 5.0
    assert [column.name for column in COLUMNS] == list(guarded)


def test_a_jump_of_the_pose_stops_the_robot_for_a_second_look_only():
    row = _row("pose_jumps", 1)
    assert row["zero_s"] <= 0.05
    assert row["later_m"] > 0.0


def test_the_robot_stands_at_the_next_cell_when_waypoints_stop():
    assert _row("waypoints_stop", 1)["way_m"] < 2.0


def test_without_a_fault_the_guard_changes_nothing():
    guarded, unguarded = _row("none", 1), _row("none", 0)
    assert math.isfinite(guarded["time_of_arrival_s"])
    for name in ("time_of_arrival_s", "way_m", "person_on_robot"):
        assert guarded[name] == unguarded[name]


def test_every_fault_runs_with_and_without_the_guard_on_every_seed():
    tasks = tasks_of(["none", "scan_nan"], replace(CONDITION, n_people=3), range(2))
    assert len(set(tasks)) == 8
    assert {task.n_people for task in tasks} == {3}


OUTCOME = {
    "began": 1,
    "speed_mps": 1.2,
    "zero_s": 0.1,
    "stood_s": 0.6,
    "stood_m": 0.4,
    "later_m": 0.0,
    "way_m": 0.4,
    "duration_s": 36.0,
    "time_of_arrival_s": 36.0,
    "robot_on_person": 0,
    "person_on_robot": 1,
    "robot_on_wall": 0,
    "n_input_stops": 0,
    "n_collision_stops": 0,
}


def _rows(**by_guard):
    return [
        {"fault": "none", "guarded": guarded, "seed": seed} | OUTCOME | each
        for guarded, episodes in ((0, by_guard["without"]), (1, by_guard["with_"]))
        for seed, each in enumerate(episodes)
    ]


def test_a_summary_has_means_and_maxima_of_the_episodes_with_a_fault():
    rows = _rows(
        without=[{}],
        with_=[{}, {"stood_s": 1.0, "n_input_stops": 2}, {"stood_s": math.nan}, {"began": 0}],
    )
    _, guarded = summarise_faults(rows).itertuples()
    assert (guarded.n_episodes, guarded.n_stood) == (3, 2)
    assert guarded.mean_stood_s == pytest.approx(0.8)
    assert guarded.largest_stood_s == 1.0
    assert guarded.n_input_stops == 2
    assert guarded.hours == pytest.approx(0.03)


def test_the_price_compares_seeds_that_arrive_in_both():
    rows = _rows(
        without=[{"time_of_arrival_s": 40.0}, {"time_of_arrival_s": math.nan}],
        with_=[{"time_of_arrival_s": 41.0}, {"time_of_arrival_s": 90.0}],
    )
    assert arrival_price(rows, "none") == pytest.approx(0.025)
    assert math.isnan(arrival_price(rows, "none_scan"))
