"""`serd bag`: contents and faults of recordings, and new ones made of them."""

import subprocess
import sys

from serd_app.drives.mapping import BagMapping
from serd_bag.command.main import main
from serd_bag.command.options import COMMANDS, flags_of
from serd_bag.reader import BagReader
from serd_cli.processes import stack_run
from serd_files.yaml_config import load_yaml_model


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


def test_bags_are_rescued_with_what_is_lost_and_sound_ones_converted(serd, drive_bag, tmp_path):
    bag, target = drive_bag(), tmp_path / "new"
    before = contents(bag)
    words = ("bag", "convert", bag, "--output", target, "--compression", "zstd", "--json")
    (values,) = serd(*words).values
    assert (values["n_messages"], values["damage"]) == (108, [])
    assert values["target"] == str(target)
    assert contents(target) == before
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    place = len(content) // 3
    content[place : place + 300] = bytes(300)
    file.write_bytes(content)
    ended = serd("bag", "rescue", bag, "--verified-only")
    assert ended.code == 1
    assert "messages lost: 1" in ended.out
    assert set(contents(bag.with_name("drive_rescued"))) < set(before)
    assert file.read_bytes() == content


def test_it_has_the_commands_options_and_results_of_serd_bag(serd, drive_bag, capsys):
    bag = drive_bag()
    for name, (options, about, _) in COMMANDS.items():
        shown = " ".join(serd("bag", name, "--help").out.replace("│", " ").split())
        assert about[1:] in shown
        assert all(f" {flags_of(option)[0]} " in shown for option in options.split())
    for words in (["cat", bag, "--columns", "vector.x", "--topic", "/intent"], ["diff", bag, bag]):
        ended = serd("bag", *words)
        assert main([str(word) for word in words]) == ended.code == 0
        assert capsys.readouterr().out.splitlines()[0] == ended.out.splitlines()[0]
    assert "diff must have 2 BAGs, got 1" in serd("bag", "diff", bag).err


def test_a_part_of_the_standard_input_is_written_to_the_standard_output(drive_bag, tmp_path):
    file = next(drive_bag().glob("*.mcap"))
    program = "import sys; from serd_cli.main import main; sys.exit(main())"
    words = ["bag", "cut", "-", "--output", "-", "--to", "5", "--topic", "/robot_pose"]
    done = subprocess.run(
        [sys.executable, "-c", program, *words], input=file.read_bytes(), capture_output=True
    )
    assert done.returncode == 0
    assert "standard_input.mcap -> " in done.stderr.decode()
    (tmp_path / "part.mcap").write_bytes(done.stdout)
    assert [message[0] for message in contents(tmp_path / "part.mcap")] == ["/robot_pose"] * 50


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


def test_options_of_play_become_parameters_of_the_node(serd, drive_bag, monkeypatch):
    nodes, bag = [], drive_bag()
    monkeypatch.setattr(stack_run, "node_command", lambda *words: nodes.append(words) or ["true"])
    monkeypatch.setattr(stack_run.os, "execve", lambda *_: None)
    given = ["--rate", "10", "--start", "2", "--topic", "intent", "--wait-for", "learner"]
    given += ["--duration", "3", "--loop"]
    ended = serd("bag", "play", bag, *given, "--remap", "intent:=other")
    assert ended.code == 0, ended.err
    ((node, parameters, remappings, _),) = nodes
    assert (node, remappings) == ("bag_replay", {"intent": "other"})
    assert parameters["bag"] == str(bag.resolve())
    assert (parameters["rate"], parameters["start_s"]) == (10.0, 2.0)
    assert (parameters["duration_s"], parameters["loop"]) == (3.0, True)
    assert (parameters["topics"], parameters["required_nodes"]) == (("intent",), ("learner",))
