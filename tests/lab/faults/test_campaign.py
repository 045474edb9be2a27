"""The fault campaign: rows of single episodes, and their summary."""

import math
from dataclasses import replace

import pytest

from lab.command.faults import summarise_faults
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


def test_without_a_fault_the_guard_changes_nothing():
    guarded, unguarded = _row("none", 1), _row("none", 0)
    assert math.isfinite(guarded["time_of_arrival_s"])
    for name in ("time_of_arrival_s", "way_m", "person_on_robot"):
        assert guarded[name] == unguarded[name]


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
    **dict.fromkeys(("robot_on_person", "person_on_robot", "robot_on_wall"), 0),
    **dict.fromkeys(("n_input_stops", "n_collision_stops"), 0),
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
