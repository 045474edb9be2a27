"""`serd bag`: contents and faults of recordings, and new ones made of them."""

import sys
from dataclasses import replace

import pytest

from serd_app.drives.mapping import BagMapping
from serd_bag.formats.mcap.writer import McapWriter
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_cli.output import terminal
from serd_cli.processes import stack_run
from serd_files.yaml_config import load_yaml_model
from support.bag_messages import POSE


def contents(bag):
    return [tuple(message) for message in BagReader(bag).messages()]


def test_info_shows_every_topic_with_its_type_and_count(serd, drive_bag):
    ended = serd("bag", "info", drive_bag("one"))
    assert ended.code == 0
    assert "108 messages on 3 topics in 10 s" in ended.out
    (row,) = [line for line in ended.out.splitlines() if "/robot_pose" in line]
    assert "geometry_msgs/msg/PoseStamped" in row
    assert "101" in row
    values = serd("bag", "info", drive_bag("two"), drive_bag("three"), "--json").values
    assert [each["n_messages"] for each in values] == [108, 108]
    counts = {topic["name"]: topic["n_messages"] for topic in values[0]["topics"]}
    assert counts == {"/robot_pose": 101, "/intent": 5, "/episode": 2}


def test_a_sound_bag_passes_the_check_and_a_missing_topic_fails_it(serd, drive_bag):
    ended = serd("bag", "check", drive_bag(), "--require", "robot_pose")
    assert ended.code == 0
    assert "sound: " in ended.out
    assert "fault" not in ended.out
    bag = drive_bag("silent", intents=False)
    ended = serd("bag", "check", bag, "--require", "robot_pose", "--require", "intent")
    assert ended.code == 1
    assert "fault: topic intent has no message" in ended.out
    assert "note: /intent: no message" in ended.out
    assert f"not sound: {bag} (1 fault)" in ended.out


def test_bags_are_recovered_and_converted_with_what_is_lost_or_left_out(
    serd, drive_bag, tmp_path, monkeypatch
):
    bag, target = drive_bag(), tmp_path / "new"
    before = contents(bag)
    words = ("bag", "convert", bag, "--output", target, "--compression", "zstd", "--json")
    (values,) = serd(*words).values
    assert (values["n_messages"], values["n_left_out"], values["n_lost"]) == (108, 0, 0)
    assert values["target"] == str(target)
    assert contents(target) == before
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 1
    file.write_bytes(content)
    assert "messages lost: 1" in serd("bag", "recover", bag).out
    assert set(contents(bag.with_name("drive_recovered"))) < set(before)
    assert file.read_bytes() == content
    add_topic = McapWriter.add_topic
    monkeypatch.setattr(
        McapWriter, "add_topic", lambda self, each: add_topic(self, replace(each, encoding="json"))
    )
    other = drive_bag("other")
    monkeypatch.undo()
    ended = serd("bag", "convert", other)
    assert ended.code == 1
    assert "0 messages, 108 left out" in ended.out


def test_rates_are_those_on_the_whole_and_usual_ones_or_a_dash(serd, tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for name in ("/map", "/often"):
            writer.add_topic(name, "std_msgs/msg/String")
        writer.write("/map", b"", 0)
        for time_s in (0.0, 0.1, 0.2, 9.9, 10.0):
            writer.write("/often", b"", round(time_s * 1e9))
    for command, rates in (("info", ["0.400"]), ("check", ["0.400", "10.0"])):
        lines = serd("bag", command, tmp_path / "bag").out.replace("│", " ").splitlines()
        rows = {line.split()[0]: line.split() for line in lines if line.lstrip().startswith("/")}
        assert rows["/map"].count("-") == len(rates)
        assert set(rates) <= set(rows["/often"])
    assert any("gap [s]" in line for line in lines)


def test_topics_have_width_in_a_pipe_also_beside_long_delays(serd, messages, tmp_path, monkeypatch):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a/rather/long/name", POSE)
        for number in range(50):
            pose = messages.pose(number, 0.0, 0.0)
            writer.write("/a/rather/long/name", pose, round((1.7e9 + 1.5 * number) * 1e9))
    monkeypatch.setattr(terminal.console, "_width", 80)
    out = serd("bag", "check", tmp_path / "bag").out
    assert max(map(len, out.splitlines()[1:6])) <= 80
    assert "│ /a/rather/" in out


def test_a_suggested_mapping_is_printed_written_and_given_as_json(serd, key_driven_bag, tmp_path):
    bag, mapping = key_driven_bag, tmp_path / "mapping.yaml"
    ended = serd("bag", "suggest", bag, "--output", mapping)
    assert ended.code == 0
    assert mapping.read_text().rstrip() in ended.out
    command = next(line for line in ended.out.splitlines() if line.startswith("next: serd demos"))
    assert serd(*command.removeprefix("next: serd ").split()).code == 0
    values = serd("bag", "suggest", bag, "--json").values
    assert values["mapping"] == load_yaml_model(mapping, BagMapping).model_dump(mode="json")
    assert values["report"]["n_moving_waits"] == 0


@pytest.fixture
def played(monkeypatch):
    """Nodes that would take the place of this process, and topics that had to be free for them."""
    nodes, topics = [], []
    monkeypatch.setattr(stack_run, "require_free", lambda _, *names: topics.extend(names))
    monkeypatch.setattr(stack_run, "node_command", lambda *words: nodes.append(words) or ["true"])
    monkeypatch.setattr(stack_run.os, "execve", lambda *_: None)
    return nodes, topics


def test_options_of_play_become_parameters_of_the_node(serd, drive_bag, played):
    bag = drive_bag()
    given = ["--rate", "10", "--start", "2", "--topic", "intent", "--wait-for", "learner"]
    ended = serd("bag", "play", bag, *given, "--remap", "intent:=other", "--no-clock")
    assert ended.code == 0, ended.err
    ((node, parameters, remappings, _),), topics = played
    assert (node, remappings, topics) == ("bag_replay", {"intent": "other"}, [])
    assert parameters["bag"] == str(bag.resolve())
    assert (parameters["rate"], parameters["start_s"], parameters["clock_hz"]) == (10.0, 2.0, 0.0)
    assert (parameters["topics"], parameters["required_nodes"]) == (("intent",), ("learner",))


def test_a_played_clock_must_have_no_other_publisher(serd, drive_bag, played):
    bag = drive_bag()
    for words in ((), ("--remap", "/clock:=/robot1/clock")):
        assert serd("bag", "play", bag, *words).code == 0
    assert played[1] == ["/clock", "/robot1/clock"]


@pytest.mark.usefixtures("played")
def test_with_json_the_number_of_played_messages_is_printed(serd, drive_bag, monkeypatch):
    code = "from serd_ros.process.progress import *; "
    code += "print('played 12 messages of a bag'); write_progress(Progress(text='', n_messages=12))"
    monkeypatch.setattr(stack_run, "node_command", lambda *_: [sys.executable, "-c", code])
    ended = serd("bag", "play", bag := drive_bag(), "--json")
    assert ended.values == {"bag": str(bag.resolve()), "messages": 12}
    assert "played 12 messages of a bag" in ended.err
