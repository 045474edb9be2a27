"""`serd demos`: recordings become decisions, a grid and a picture, and nothing is lost unsaid."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from serd_app.demonstrations.decision_table import load_decisions
from serd_app.demonstrations.grid.flow_field import load_flow
from serd_app.demonstrations.recorded import DemonstrationRecord, report_of_table
from serd_bag.errors import FileError
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action
from serd_files.grid_file import load_grid
from serd_files.model_file import ModelFile
from serd_files.yaml_config import load_yaml_model
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario


@pytest.mark.usefixtures("whole_pictures")
def test_a_recording_becomes_a_table_beside_its_grid_and_picture(serd, drive_bag, tmp_path):
    table = tmp_path / "out" / "decisions.csv"
    ended = serd("demos", drive_bag(), "--scenario", "hallway", "--output", table)
    assert ended.code == 0
    decisions, grid = load_decisions(table), load_grid(table.with_suffix(".grid.yaml"))
    assert grid.fingerprint() == grid_of(load_scenario("hallway")).fingerprint()
    states = [grid.state_at(4.5, 1.5 + row) for row in range(6)]
    assert decisions.state.tolist() == states
    assert decisions.next_state.tolist() == [*states[1:], states[-1]]
    np.testing.assert_allclose(decisions.dwell_s, [1.2, 2.0, 2.0, 2.0, 2.0, 0.8], atol=1e-6)
    assert decisions.censored.tolist() == [False] * 5 + [True]
    assert set(decisions.action.tolist()) == {Action.NORTH}
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert f"decisions: {table}" in ended.out
    assert f"next: serd learn {table} --report report" in ended.out


def test_beside_the_table_is_what_learning_reads(serd, drive_bag, tmp_path):
    table = tmp_path / "decisions.csv"
    table.with_suffix(".flow.csv").write_text("of another recording")
    values = serd("demos", drive_bag(), "--scenario", "hallway", "--output", table, "--json").values
    record = load_yaml_model(table.with_suffix(".yaml"), DemonstrationRecord)
    assert (record.scenario, record.patience_s, record.wait_s) == ("hallway", 4.0, 1.0)
    assert record.grid_fingerprint == load_grid(table.with_suffix(".grid.yaml")).fingerprint()
    assert [each.n_decisions for each in record.bags] == [6]
    assert values["flow"] is None
    assert not table.with_suffix(".flow.csv").exists()


@pytest.mark.usefixtures("whole_pictures")
def test_where_people_were_recorded_their_flow_is_told(serd, drive_bag, people_bag, tmp_path):
    table = tmp_path / "decisions.csv"
    words = ("demos", drive_bag(), people_bag(), "--output", table, "--scenario", "hallway")
    values = serd(*words, "--json").values
    grid = load_grid(table.with_suffix(".grid.yaml"))
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


def without(bag, target, lost):
    """A copy of a bag without the messages of a topic within two times (s)."""
    topic, from_s, until_s = lost
    with BagWriter(target) as writer:
        for each in BagReader(bag).topics.values():
            writer.add_topic(each.name, each.type_name)
        for message in BagReader(bag).messages():
            if message.topic != topic or not from_s < message.log_time_ns / 1e9 < until_s:
                writer.write(message.topic, message.data, message.log_time_ns)
    return target


def test_decisions_that_a_gap_of_poses_loses_are_faults(serd, drive_bag, tmp_path):
    table = tmp_path / "decisions.csv"
    torn = without(drive_bag(), tmp_path / "torn", ("/robot_pose", 104.5, 105.5))
    words = ("demos", torn, "--scenario", "hallway", "--output", table)
    assert serd(*words, "--json").values["bags"][0]["fault_share"] == 1 / 6
    report = report_of_table(table)
    assert (report.n_decisions, report.n_taken) == (5, 6)
    assert "16.7 % of 6 decisions are lost as poses are missing or beyond walls" in serd(*words).out
    ended = serd("demos", drive_bag("other"), "--scenario", "hallway", "--output", table)
    assert "are lost" not in ended.out
    assert report_of_table(table).fault_share == 0.0
    assert report_of_table(tmp_path / "another.csv") is None


def test_episodes_of_several_bags_stay_apart(serd, drive_bag):
    bags = drive_bag("one"), drive_bag("two", x_m=5.5)
    values = serd("demos", *bags, "--scenario", "hallway", "--json").values
    assert [each["n_decisions"] for each in values["bags"]] == [6, 6]
    assert load_decisions(values["files"]["decisions"]).episode.tolist() == [0] * 6 + [1] * 6


def test_what_is_dropped_is_counted_with_its_reason(serd, drive_bag):
    bags = drive_bag("good"), drive_bag("far", x_m=40.0)
    ended = serd("demos", *bags, "--scenario", "hallway")
    assert ended.code == 0
    assert "dropped 3: robot off the grid" in ended.out
    assert "far: 3 of 3 decisions with the robot off the grid; is it this scenario?" in ended.out
    assert "good:" not in ended.out


def test_bags_without_a_single_decision_are_refused_with_the_counts(serd, drive_bag, tmp_path):
    refusal = serd("demos", drive_bag(x_m=40.0), "--scenario", "hallway").refusal
    assert "there is no decision to learn from" in refusal
    assert "3 robot off the grid" in refusal
    assert not list((tmp_path / "here").iterdir())


def test_a_damaged_bag_is_used_only_when_asked_to(serd, drive_bag):
    bag = drive_bag()
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert "serd bag recover" in serd("demos", bag, "--scenario", "hallway").refusal
    words = ("demos", bag, "--scenario", "hallway", "--tolerant")
    values = serd(*words, "--json").values
    assert 0 < values["bags"][0]["n_decisions"] < 6
    damage = values["bags"][0]["damage"]
    assert "at byte" in damage[0]
    record = load_yaml_model(values["files"]["record"], DemonstrationRecord).bags[0]
    assert list(record.damage) == damage
    assert record.n_lost == values["bags"][0]["n_lost"] > 0
    assert f"drive: {damage[0]}" in serd(*words).out
    (bag / "metadata.yaml").unlink()
    assert "drive: messages lost: unknown, the damaged bag has no count\n" in serd(*words).out


def test_a_bag_given_twice_and_its_copy_count_once(serd, drive_bag, people_bag, tmp_path):
    bag, people = drive_bag(), people_bag()
    copy = serd("bag", "convert", people, "--output", tmp_path / "copy")
    assert copy.code == 0, copy.err
    words = ("demos", bag, people, bag, tmp_path / "copy", "--scenario", "hallway")
    values = serd(*words, "--json").values
    assert [each["n_decisions"] for each in values["bags"]] == [6, 0, 0, 0]
    assert values["bags"][2]["dropped"] == {"of an episode that was there before": 6}
    assert load_decisions(values["files"]["decisions"]).episode.tolist() == [0] * 6
    assert values["flow"]["n_sightings"] == 60


def runs_among_people(folder, n_runs=4):
    """Tables of a robot that drives east at 0.8 m/s and of two people who come towards it."""
    rng = np.random.default_rng(3)
    time_s = np.arange(90) / 10
    for run in range(n_runs):
        robot = np.column_stack([0.4 + 0.8 * time_s, 0.4 + rng.normal(size=90) / 100])
        people = [np.column_stack([9.0 - time_s, np.full(90, y_m)]) for y_m in (1.2, 2.0)]
        rows = [
            pd.DataFrame({"timestamp": (1e9 * (1000 * run + time_s)).astype(np.int64),
                          "x": place[:, 0], "y": place[:, 1], "column": number,
                          "robot_x": robot[:, 0], "robot_y": robot[:, 1], "robot_yaw_rad": 0.0})
            for number, place in enumerate(people, start=1)
        ]  # fmt: skip
        table = pd.concat(rows).sort_values("timestamp", kind="stable")
        table.to_csv(folder / f"run_{run}.csv", index=False)
        yield folder / f"run_{run}.csv", robot


def test_of_tables_of_a_robot_among_people_the_robot_is_learned_from(serd, tmp_path):
    files, robots = zip(*runs_among_people(tmp_path), strict=True)
    table, model = tmp_path / "decisions.csv", tmp_path / "model.yaml"
    words = ("--cell-size-m", "0.8", "--output", table)
    ended = serd("demos", *files, *words)
    assert ended.code == 0
    assert ended.out.count("robot demonstrates among 2 people") == len(files)
    assert "flow of people: none was recorded" not in ended.out
    decisions, grid = load_decisions(table), load_grid(table.with_suffix(".grid.yaml"))
    for number, robot in enumerate(robots):
        states = decisions.state[decisions.episode == number]
        assert states.tolist() == list(dict.fromkeys(grid.states_at(robot).tolist()))
    assert serd("learn", table, "--output", model).code == 0
    grid_of_model = load_yaml_model(model, ModelFile).grid
    assert grid_of_model.fingerprint == grid.fingerprint()


def test_without_a_scenario_a_grid_is_fitted_to_all_recordings(serd, drive_bag, tmp_path):
    bags, table = (drive_bag("one"), drive_bag("two", x_m=40.5)), tmp_path / "decisions.csv"
    ended = serd("demos", *bags, "--cell-size-m", "1", "--output", table)
    assert ended.code == 0
    decisions, grid = load_decisions(table), load_grid(table.with_suffix(".grid.yaml"))
    expected = [grid.state_at(x_m, 1.5 + row) for x_m in (4.5, 40.5) for row in range(6)]
    assert decisions.state.tolist() == expected
    assert grid.state_at(20.5, 3.5) == -1
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_cells_fit_the_motion_of_a_foreign_robot_where_no_size_is_given(serd, drive_bag, tmp_path):
    """It drives half a metre in a second."""
    mapping, table = tmp_path / "mapping.yaml", tmp_path / "decisions.csv"
    mapping.write_text("pose_topic: /amcl\naction_topic: /wish\n")
    bag = drive_bag(pose="/amcl", intent="/wish")
    words = ("demos", bag, "--mapping", mapping, "--output", table)
    assert serd(*words).code == 0
    assert load_grid(table.with_suffix(".grid.yaml")).cell_size_m == 0.5
    assert load_yaml_model(table.with_suffix(".yaml"), DemonstrationRecord).patience_s == 4.0
    assert serd(*words, "--cell-size-m", 2).code == 0
    assert load_yaml_model(table.with_suffix(".yaml"), DemonstrationRecord).patience_s == 12.0


def test_a_record_of_decisions_with_a_period_is_refused(serd, drive_bag, tmp_path):
    table = tmp_path / "decisions.csv"
    assert serd("demos", drive_bag(), "--scenario", "hallway", "--output", table).code == 0
    record = table.with_suffix(".yaml")
    record.write_text(record.read_text().replace("format_version: 2", "format_version: 1"))
    with pytest.raises(FileError, match="got 1 of another version; run 'serd demos' again"):
        report_of_table(table)


def test_a_recording_of_ours_needs_its_scenario_or_a_cell_size(serd, drive_bag):
    bag = drive_bag()
    refusal = serd("demos", bag).refusal
    assert f"either --scenario or --cell-size-m must be given for {bag}, got neither" in refusal


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("nowhere", "--scenario", "hallway"), "cannot read nowhere: it does not exist"),
        (("a", "--scenario", "halway"), "did you mean 'hallway'?"),
        (("a", "--scenario", "none.yaml"), "cannot read none.yaml: it does not exist"),
        (("a",), "a must hold rows of values, it holds none"),
        (("a", "--scenario", "hallway", "--cell-size-m", "1"), "must be given, got both"),
        (("a", "--cell-size-m", "0"), "--cell-size-m must be finite and above 0, got 0"),
        (("a", "--cell-size-m", "1", "--period-s", "1"), "or after patience_s (docs/scenarios.md)"),
        (("a", "--scenario", "hallway", "--output", "a.txt"), "--output must end in .csv"),
        (("a", "--scenario", "hallway", "--mapping", "m.yaml"), "cannot read m.yaml"),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(serd, words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a").touch()
    assert sentence in serd("demos", *words).refusal


@pytest.mark.parametrize(
    "words",
    [
        ("a", "--scenario", "hallway", "--mapping", "m.yaml", "--output", "m.csv"),
        ("a", "--scenario", "m.yaml", "--output", "m.csv"),
    ],
)
def test_what_is_read_is_not_overwritten(serd, words):
    for name in ("a", "m.yaml"):
        Path(name).touch()
    sentence = "--output must not overwrite what is read, m.csv would overwrite m.yaml"
    assert sentence in serd("demos", *words).refusal


def test_a_foreign_bag_without_a_mapping_gets_the_command_that_writes_one(serd, drive_bag):
    bag = drive_bag(pose="/amcl")
    refusal = serd("demos", bag, "--scenario", "hallway").refusal
    assert "it holds no robot_pose but /amcl, /episode, /intent; " in refusal
    assert f"'serd bag suggest {bag}' writes a mapping.yaml" in refusal


def test_a_mapping_that_does_not_fit_gets_the_command_that_writes_one(serd, drive_bag, tmp_path):
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("pose_topic: /nowhere\n")
    bag = drive_bag()
    refusal = serd("demos", bag, "--scenario", "hallway", "--mapping", mapping).refusal
    assert "bag must hold the topic '/nowhere'" in refusal
    assert f"'serd bag suggest {bag}' writes a mapping that fits" in refusal


def test_waits_while_the_robot_moves_are_reported_with_the_command_that_helps(
    serd, key_driven_bag, tmp_path
):
    bag = key_driven_bag
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text(
        "pose_topic: odom\naction_from: velocity\naction_topic: cmd_vel\nsilence: wait\n"
    )
    words = ("demos", bag, "--cell-size-m", "0.5", "--mapping", mapping)
    (found,) = serd(*words, "--json").values["bags"]
    assert found["n_moving_waits"] > 0.1 * found["n_decisions"]
    sentence = f"{found['n_moving_waits']} of {found['n_decisions']} decisions wait while the robot"
    assert sentence in serd(*words).out
    assert f"'serd bag suggest {bag}' finds how long it follows a command" in serd(*words).out
    assert serd("bag", "suggest", bag, "--output", mapping).code == 0
    ended = serd(*words)
    assert ended.code == 0
    assert "while the robot moves" not in ended.out


def test_a_drive_that_gaps_cut_into_pieces_is_said_to_be_so(serd, drive_bag, tmp_path):
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("pose_topic: /amcl\naction_topic: /wish\n")
    bag = drive_bag(pose="/amcl", intent="/wish")
    without(bag, tmp_path / "gaps", ("/amcl", 104.5, 105.5))
    options = ("--scenario", "hallway", "--mapping", mapping)
    ended = serd("demos", tmp_path / "gaps", *options)
    assert "gaps: cut into 2 episodes at 1 gap of more than 0.5 s between poses; " in ended.out
    assert "cut into" not in serd("demos", bag, *options).out


def test_actions_can_be_hidden(serd, drive_bag, tmp_path):
    """Where cells are entered, with intents or without."""
    shown, hidden = tmp_path / "shown.csv", tmp_path / "hidden.csv"
    options = ("--scenario", "hallway", "--output")
    serd("demos", drive_bag("one"), *options, shown)
    first = load_decisions(shown)
    for bag in (drive_bag("two"), drive_bag("silent", intents=False)):
        ended = serd("demos", bag, "--actions", "hidden", *options, hidden)
        assert ended.code == 0, ended.err
        found = load_decisions(hidden)
        assert found.hidden.all()
        np.testing.assert_array_equal(found.state, first.state)
        np.testing.assert_array_equal(found.next_state, first.next_state)
    assert "6 decisions without action" in ended.out


def test_a_bag_of_poses_alone_needs_no_mapping(serd, drive_bag, tmp_path):
    bag, table = tmp_path / "poses", tmp_path / "decisions.csv"
    reader = BagReader(drive_bag())
    with BagWriter(bag) as writer:
        writer.add_topic("/somewhere/pose", reader.topics["/robot_pose"].type_name)
        for message in reader.messages(["/robot_pose"]):
            writer.write("/somewhere/pose", message.data, message.log_time_ns)
    ended = serd("demos", bag, "--scenario", "hallway", "--output", table)
    assert ended.code == 0, ended.err
    assert load_decisions(table).hidden.all()
    assert len(load_decisions(table)) == 6


def test_a_mapping_of_bags_and_tables_together_is_refused(serd, drive_bag, tmp_path):
    table, mapping = tmp_path / "table.csv", tmp_path / "mapping.yaml"
    table.write_text("t,x,y\n0,1,1\n1,2,1\n")
    mapping.write_text("unit: m\n")
    refusal = serd("demos", drive_bag(), table, "--cell-size-m", "1", "--mapping", mapping).refusal
    assert "--mapping must be for bags or for tables" in refusal


def test_each_agent_of_a_table_is_a_demonstration_among_the_others(serd, tmp_path):
    """20 people side by side walk east along y = 0.25 m and 0.75 m, in equal cells at one time."""
    path, table = tmp_path / "people.csv", tmp_path / "decisions.csv"
    lines = [
        f"{agent},{0.2 * step},{0.25 * step},{0.25 + 0.5 * (agent % 2)}"
        for agent in range(20)
        for step in range(41)
    ]
    path.write_text("id,t,x,y\n" + "\n".join(lines))
    values = serd("demos", path, "--cell-size-m", 1, "--output", table, "--json").values
    assert (values["bags"][0]["n_decisions"], values["bags"][0]["n_episodes"]) == (200, 20)
    assert load_decisions(table).hidden.all()
    assert values["flow"]["n_known"] == 11
    mapping = tmp_path / "mapping.yaml"
    mapping.write_text("action_from: motion\n")
    words = ("demos", path, "--cell-size-m", 1, "--output", table)
    assert serd(*words, "--mapping", mapping).code == 0
    assert set(load_decisions(table).action.tolist()) == {Action.EAST}
    mapping.write_text("unit: cm\nstop_s: 5\n")
    first, again = serd(
        "demos", path, path, "--mapping", mapping, "--cell-size-m", 0.01, "--json"
    ).values["bags"]
    assert (first["n_episodes"], again["n_episodes"]) == (20, 0)
    mapping.write_text("pose_topic: odom\n")
    ended = serd("demos", path, "--mapping", mapping, "--cell-size-m", 1)
    assert "pose_topic is not a known key" in ended.err


def test_people_of_a_bag_can_be_the_experts(serd, people_bag, tmp_path):
    mapping, table = tmp_path / "mapping.yaml", tmp_path / "decisions.csv"
    mapping.write_text("experts: people\n")
    words = ("--mapping", mapping, "--cell-size-m", 1, "--output", table, "--json")
    values = serd("demos", people_bag(), *words).values
    assert values["bags"][0]["n_episodes"] == 2
    assert values["flow"]["n_sightings"] == 60
    grid, decisions = load_grid(tmp_path / "decisions.grid.yaml"), load_decisions(table)
    assert decisions.hidden.all()
    assert set(decisions.state.tolist()) == {grid.state_at(4.5, 8.5), grid.state_at(1.5, 8.5)}


def test_an_area_says_what_is_walkable(serd, tmp_path):
    """Two people; one leaves the area."""
    rows = [(1, t, 0.5 + t, 0.5) for t in range(5)] + [(2, t, 1.5, 0.5 + t) for t in range(5)]
    lines = (",".join(map(str, row)) for row in rows)
    (tmp_path / "walk.csv").write_text("\n".join(["id,t,x,y", *lines]) + "\n")
    (tmp_path / "room.wkt").write_text("POLYGON ((0 0, 6 0, 6 3, 0 3, 0 0))")
    words = ("demos", tmp_path / "walk.csv", "--area", tmp_path / "room.wkt")
    ended = serd(*words, "--cell-size-m", 1, "--output", "walk.decisions.csv")
    assert ended.code == 0, ended.err
    table = tmp_path / "here" / "walk.decisions.csv"
    grid, decisions = load_grid(table.with_suffix(".grid.yaml")), load_decisions(table)
    assert (grid.origin_m, grid.walkable.shape, grid.n_states) == ((0.0, 0.0), (3, 6), 18)
    assert np.bincount(decisions.episode).tolist() == [5, 2]
    assert "robot off the grid" in ended.out
    refusal = serd(*words, "--scenario", "hallway").refusal
    assert "either --scenario or --area must be given, got both" in refusal
    small = serd(*words, "--cell-size-m", 100)
    assert "cell_size_m must leave a cell whose centre is in the area, got 100 m" in small.err
    other = serd("demos", tmp_path / "walk.csv", "--area", tmp_path / "room.png")
    assert "must end in .wkt, .geojson, .json" in other.err


def test_equal_decisions_of_several_tables_count_and_a_table_given_twice_once(serd, tmp_path):
    """Times of each table begin at 0, and all robots drive through the same cells."""
    paths = [tmp_path / f"run{n}.csv" for n in range(3)]
    for number, path in enumerate(paths):
        rows = (f"{step / 10},{0.1 * step},{0.01 * number}" for step in range(60))
        path.write_text("\n".join(["t,x,y", *rows]) + "\n")
    words = ("--cell-size-m", 1, "--json")
    one, three, twice = (
        sum(bag["n_decisions"] for bag in serd("demos", *given, *words).values["bags"])
        for given in (paths[:1], paths, [paths[0], paths[0]])
    )
    assert (one > 0, three, twice) == (True, 3 * one, one)


def test_cells_where_people_walk_beside_a_robot_are_walkable_and_those_elsewhere_are_not(
    serd, tmp_path
):
    path, output = tmp_path / "drive.csv", tmp_path / "decisions.csv"
    rows = [
        (step / 10, who, x_m, y_m)
        for step in range(60)
        for who, x_m, y_m in (
            ("robot", 0.1 * step, 0.5),
            ("anna", 6 - 0.1 * step, 3.5),
            ("far", 500 + 0.1 * step, 900.0),
        )
    ]
    path.write_text("t,id,x,y\n" + "".join(f"{t},{who},{x},{y}\n" for t, who, x, y in rows))
    words = ("--cell-size-m", 1, "--output", output)
    assert serd("demos", path, *words).code == 0
    grid = load_grid(output.with_suffix(".grid.yaml"))
    states = grid.states_at(np.array([[3.0, 3.5], [3.0, 4.5], [3.0, 6.5], [503.0, 900.0]]))
    assert (states >= 0).tolist() == [True, True, False, False]
