"""`serd bag`: contents and faults of recordings, and new ones made of them."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from serd_app.drives.mapped.mapping import BagMapping
from serd_bag.formats.mcap.writer import McapWriter
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_files.yaml_config import load_yaml_model
from support.bag_messages import POSE


def damage(bag):
    """Cut the end off, as a crash does."""
    (bag / "metadata.yaml").unlink()
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def contents(bag):
    return [tuple(message) for message in BagReader(bag).messages()]


def test_info_shows_every_topic_with_its_type_and_count(serd, drive_bag):
    ended = serd("bag", "info", drive_bag())
    assert ended.code == 0
    assert "108 messages on 3 topics in 10 s" in ended.out
    (row,) = [line for line in ended.out.splitlines() if "/robot_pose" in line]
    assert "geometry_msgs/msg/PoseStamped" in row
    assert "101" in row


def test_info_as_json_is_one_entry_per_bag(serd, drive_bag):
    values = serd("bag", "info", drive_bag("one"), drive_bag("two"), "--json").values
    assert [each["n_messages"] for each in values] == [108, 108]
    assert {topic["name"]: topic["n_messages"] for topic in values[0]["topics"]} == {
        "/robot_pose": 101,
        "/intent": 5,
        "/episode": 2,
    }


def test_a_sound_bag_passes_the_check(serd, drive_bag):
    ended = serd("bag", "check", drive_bag(), "--require", "robot_pose")
    assert ended.code == 0
    assert "sound: " in ended.out
    assert "fault" not in ended.out


def test_a_missing_topic_fails_the_check(serd, drive_bag):
    bag = drive_bag(intents=False)
    ended = serd("bag", "check", bag, "--require", "robot_pose", "--require", "intent")
    assert ended.code == 1
    assert "fault: topic intent has no message" in ended.out
    assert "note: /intent: no message" in ended.out
    assert f"not sound: {bag} (1 fault)" in ended.out


def test_a_broken_bag_is_recovered_beside_it_and_left_as_it_is(serd, drive_bag):
    bag = drive_bag()
    before = contents(bag)
    damage(bag)
    broken = next(bag.glob("*.mcap")).read_bytes()
    ended = serd("bag", "recover", bag)
    assert ended.code == 0
    assert "damage: " in ended.out
    after = contents(bag.with_name("drive_recovered"))
    assert after == before[: len(after)]
    assert len(after) > 20
    assert next(bag.glob("*.mcap")).read_bytes() == broken


def test_convert_keeps_every_message_and_reports_it_as_json(serd, drive_bag, tmp_path):
    bag = drive_bag()
    target = tmp_path / "new"
    (values,) = serd(
        "bag", "convert", bag, "--output", target, "--compression", "zstd", "--json"
    ).values
    assert (values["n_messages"], values["n_left_out"], values["n_lost"]) == (108, 0, 0)
    assert values["target"] == str(target)
    assert contents(target) == contents(bag)


def test_what_cannot_be_copied_is_counted_and_fails(serd, drive_bag, monkeypatch):
    add_topic = McapWriter.add_topic
    monkeypatch.setattr(
        McapWriter, "add_topic", lambda self, each: add_topic(self, replace(each, encoding="json"))
    )
    bag = drive_bag()
    monkeypatch.undo()
    ended = serd("bag", "convert", bag)
    assert ended.code == 1
    assert "0 messages, 108 left out" in ended.out
    assert "0 of 101" in ended.out


def test_losses_that_are_known_only_in_part_are_called_so(serd, tmp_path, drive_bag):
    bag = drive_bag()
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 1
    file.write_bytes(content)
    assert "messages lost: 1" in serd("bag", "recover", bag).out
    (bag / "metadata.yaml").unlink()
    assert (
        "messages lost: at least 1" in serd("bag", "recover", bag, "--output", tmp_path / "b").out
    )


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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("info", "nowhere"), "cannot read nowhere: it does not exist"),
        (("info", "one"), "bag one must be a folder or a .mcap, .db3 or .bag file"),
        (("recover", "one", "two", "--output", "new"), "--output must be left out for several"),
        (("chek", "one"), "Did you mean 'check'?"),
        (("info", "one", "--jsno"), "--json"),
        (("convert", "one", "--compression", "gzip"), "'none', 'zstd'"),
    ],
)
def test_bad_input_prints_an_error_and_exits_with_2(serd, words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("one", "two"):
        Path(name).touch()
    ended = serd("bag", *words)
    assert ended.code == 2
    assert message in ended.err
    assert ended.out == ""


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


def test_topics_have_width_in_a_pipe_also_beside_long_delays(messages, tmp_path, root):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/a/rather/long/name", POSE)
        for number in range(50):
            pose = messages.pose(number, 0.0, 0.0)
            writer.write("/a/rather/long/name", pose, round((1.7e9 + 1.5 * number) * 1e9))
    environment = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
    command = [sys.executable, "-m", "serd_cli.main", "bag", "check", tmp_path / "bag"]
    out = subprocess.run(
        command, check=True, capture_output=True, text=True, env=environment, cwd=root
    ).stdout
    assert max(map(len, out.splitlines()[1:6])) <= 80
    assert "│ /a/rather/" in out
