"""`serd demos`: recordings become decisions, a grid and a picture, and nothing is lost unsaid."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import DemonstrationRecord, load_decisions, load_flow
from serd_cli.output.demonstrations import short_names
from serd_core.grid.grid import Action
from serd_files.grid_file import load_grid
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from tests.serd_cli.conftest import copied_bag

IN_HALLWAY = ("--scenario", "hallway")
TABLE = Path("decisions.csv")
RECORD, GRID = TABLE.with_suffix(".yaml"), TABLE.with_suffix(".grid.yaml")


@pytest.fixture
def mapping(tmp_path):
    """Writes a mapping file of some keys."""

    def write(*lines):
        (tmp_path / "mapping.yaml").write_text("\n".join(lines) + "\n")
        return ("--mapping", tmp_path / "mapping.yaml")

    return write


def test_a_recording_becomes_a_table_beside_its_grid_record_and_picture(serd, drive_bag, tmp_path):
    table = tmp_path / "out" / "decisions.csv"
    ended = serd("demos", drive_bag(), *IN_HALLWAY, "--output", table)
    assert ended.code == 0
    decisions, grid = load_decisions(table), load_grid(table.with_suffix(".grid.yaml"))
    assert grid.fingerprint() == grid_of(load_scenario("hallway")).fingerprint()
    states = [grid.state_at(4.5, 1.5 + row) for row in range(6)]
    assert decisions.state.tolist() == states
    assert decisions.next_state.tolist() == [*states[1:], states[-1]]
    np.testing.assert_allclose(decisions.dwell_s, [1.2, 2.0, 2.0, 2.0, 2.0, 0.8], atol=1e-6)
    assert decisions.censored.tolist() == [False] * 5 + [True]
    assert set(decisions.action.tolist()) == {Action.NORTH}
    record = load_yaml_model(table.with_suffix(".yaml"), DemonstrationRecord)
    assert (record.scenario, record.patience_s, record.wait_s) == ("hallway", 4.0, 1.0)
    assert record.grid_fingerprint == grid.fingerprint()
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert f"decisions: {table}" in ended.out
    assert f"next: serd learn {table} --report report" in ended.out


def test_where_people_were_recorded_their_flow_is_told_and_else_no_old_one_stays(
    serd, drive_bag, people_bag
):
    words = ("demos", drive_bag(), people_bag, *IN_HALLWAY)
    values = serd(*words, "--json").values
    grid = load_grid(GRID)
    flow = load_flow(values["files"]["flow"], grid)
    assert flow[grid.state_at(4.5, 8.5)] == Action.NORTH
    assert flow[grid.state_at(1.5, 8.5)] == Action.EAST
    assert (flow >= 0).sum() == 2
    assert values["flow"] == {
        "n_cells": 176, "n_known": 2, "n_sightings": 60, "n_compared": 2,
        "n_as_scenario": 1, "n_opposite": 0,
    }  # fmt: skip
    assert Path(values["files"]["flow picture"]).read_bytes().startswith(b"\x89PNG")
    assert "1 of 2 as in the scenario, 0 opposite" in serd(*words).out
    assert serd("demos", drive_bag("other"), *IN_HALLWAY, "--json").values["flow"] is None
    assert not TABLE.with_suffix(".flow.csv").exists()


def test_decisions_that_a_gap_of_poses_loses_are_faults(serd, drive_bag, tmp_path):
    def kept(message):
        return message.topic != "/robot_pose" or not 104.5 < message.log_time_ns / 1e9 < 105.5

    words = ("demos", copied_bag(drive_bag(), tmp_path / "torn", kept), *IN_HALLWAY)
    assert serd(*words, "--json").values["bags"][0]["fault_share"] == 1 / 6
    assert "16.7 % of 6 decisions are lost as poses are missing or beyond walls" in serd(*words).out
    assert "are lost" not in serd("demos", drive_bag("other"), *IN_HALLWAY).out


def test_what_is_dropped_of_several_bags_is_counted_with_its_reason(serd, drive_bag):
    bags = drive_bag("one"), drive_bag("two", x_m=5.5), drive_bag("far", x_m=40.0)
    ended = serd("demos", *bags, *IN_HALLWAY)
    assert ended.code == 0
    assert load_decisions(TABLE).episode.tolist() == [0] * 6 + [1] * 6
    assert "dropped 3: robot off the grid" in ended.out
    assert "far: 3 of 3 decisions with the robot off the grid; is it this scenario?" in ended.out
    assert "one:" not in ended.out


def test_a_damaged_bag_is_used_only_when_asked_to(serd, drive_bag):
    bag = drive_bag()
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert "serd-bag rescue" in serd("demos", bag, *IN_HALLWAY).refusal
    words = ("demos", bag, *IN_HALLWAY, "--tolerant")
    (values,) = serd(*words, "--json").values["bags"]
    assert 0 < values["n_decisions"] < 6
    assert "at byte" in values["damage"][0]
    assert values["n_lost"] > 0
    assert f"drive: {values['damage'][0]}" in serd(*words).out
    (bag / "metadata.yaml").unlink()
    assert "drive: messages lost: unknown, the damaged bag has no count\n" in serd(*words).out


def test_a_bag_given_twice_and_its_copy_count_once(serd, drive_bag, people_bag, tmp_path):
    bag, copy = drive_bag(), copied_bag(people_bag, tmp_path / "copy")
    values = serd("demos", bag, people_bag, bag, copy, *IN_HALLWAY, "--json").values
    assert [each["n_decisions"] for each in values["bags"]] == [6, 0, 0, 0]
    assert values["bags"][2]["dropped"] == {"of an episode that was there before": 6}
    assert load_decisions(TABLE).episode.tolist() == [0] * 6
    assert values["flow"]["n_sightings"] == 60


def test_waits_while_the_robot_moves_are_reported_with_the_command_that_helps(
    serd, key_driven_bag, mapping
):
    keys = "pose_topic: odom", "action_from: velocity", "action_topic: cmd_vel", "silence: wait"
    options = mapping(*keys)
    words = ("demos", key_driven_bag, "--cell-size-m", "0.5", *options)
    (values,) = serd(*words, "--json").values["bags"]
    n_waits, n_decisions = values["n_moving_waits"], values["n_decisions"]
    assert n_waits > 0.1 * n_decisions
    printed = serd(*words).out
    assert f"{n_waits} of {n_decisions} decisions wait while the robot" in printed
    helps = f"'serd bag suggest {key_driven_bag}' finds how long it follows a command"
    assert helps in printed
    assert serd("bag", "suggest", key_driven_bag, "--output", options[1]).code == 0
    ended = serd(*words)
    assert ended.code == 0
    assert "while the robot moves" not in ended.out


def test_actions_are_hidden_where_they_are_asked_to_be(serd, drive_bag):
    bag = drive_bag("one")
    assert serd("demos", bag, *IN_HALLWAY).code == 0
    shown = load_decisions(TABLE)
    for hidden in (bag, drive_bag("silent", intents=False)):
        ended = serd("demos", hidden, "--actions", "hidden", *IN_HALLWAY)
        assert ended.code == 0, ended.err
        found = load_decisions(TABLE)
        assert found.hidden.all()
        np.testing.assert_array_equal(
            [found.state, found.next_state], [shown.state, shown.next_state]
        )
    assert "6 decisions without action" in ended.out


def write_table(path, header, rows):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_each_agent_of_a_table_is_a_demonstration_among_the_others(serd, tmp_path, mapping):
    """20 people side by side walk east along y = 0.25 m and 0.75 m, in equal cells at one time."""
    steps = product(range(20), range(41))
    rows = [(agent, 0.2 * n, 0.25 * n, 0.25 + 0.5 * (agent % 2)) for agent, n in steps]
    words = ("demos", write_table(tmp_path / "people.csv", "id,t,x,y", rows))
    metre = ("--cell-size-m", 1)
    values = serd(*words, *metre, "--json").values
    assert (values["bags"][0]["n_decisions"], values["bags"][0]["n_episodes"]) == (200, 20)
    assert load_decisions(TABLE).hidden.all()
    assert values["flow"]["n_known"] == 11
    assert serd(*words, *metre, *mapping("action_from: motion")).code == 0
    assert set(load_decisions(TABLE).action.tolist()) == {Action.EAST}
    options = (*mapping("unit: cm", "stop_s: 5"), "--cell-size-m", 0.01, "--json")
    first, again = serd(*words, words[1], *options).values["bags"]
    assert (first["n_episodes"], again["n_episodes"]) == (20, 0)
    refusal = serd(*words, *metre, *mapping("pose_topic: odom")).refusal
    assert "pose_topic is not a known key" in refusal


def test_an_area_says_what_is_walkable(serd, tmp_path):
    """Two people; one leaves the area."""
    rows = [(1, t, 0.5 + t, 0.5) for t in range(5)] + [(2, t, 1.5, 0.5 + t) for t in range(5)]
    walk = write_table(tmp_path / "walk.csv", "id,t,x,y", rows)
    (tmp_path / "room.wkt").write_text("POLYGON ((0 0, 6 0, 6 3, 0 3, 0 0))")
    words = ("demos", walk, "--area", tmp_path / "room.wkt")
    ended = serd(*words, "--cell-size-m", 1)
    assert ended.code == 0, ended.err
    grid, decisions = load_grid(GRID), load_decisions(TABLE)
    assert (grid.origin_m, grid.walkable.shape, grid.n_states) == ((0.0, 0.0), (3, 6), 18)
    assert np.bincount(decisions.episode).tolist() == [5, 2]
    assert "robot off the grid" in ended.out
    for given, sentence in (
        ((*words, *IN_HALLWAY), "either --scenario or --area must be given, got both"),
        ((*words, "--cell-size-m", 100), "a cell whose centre is in the area, got 100 m"),
        (("demos", walk, "--area", tmp_path / "room.png"), "must end in .wkt, .geojson, .json"),
    ):
        assert sentence in serd(*given).refusal


def test_no_more_of_a_path_is_kept_than_tells_it_apart():
    for apart in (["run-1/bag", "run-2/bag"], ["a/run-1/b", "b/run-1/b", "b/run-2/b"]):
        assert short_names([*map(Path, apart)]) == apart
    assert short_names([Path("run-1/bag")] * 2) == ["bag", "bag"]
