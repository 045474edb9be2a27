"""`serd-bag`, the command without ROS."""

import json
import os
import subprocess
import sys

import pytest

from serd_bag.command.main import main
from serd_bag.writer import BagWriter
from support.bag_messages import POSE, write_bag
from support.damaged_files import write_wrong


def lose_a_message(bag):
    (bag / "metadata.yaml").unlink()
    content = (bag / "small_0.mcap").read_bytes()
    write_wrong(bag / "small_0.mcap", content, len(content) // 2, b"\x55\xaa\x55\xaa")


def cut_to_nothing(bag):
    os.truncate(bag / "small_0.mcap", 20)


def cut_short(bag):
    (bag / "metadata.yaml").unlink()
    os.truncate(bag / "small_0.mcap", (bag / "small_0.mcap").stat().st_size // 2)


def without_messages(bag):
    for file in bag.iterdir():
        file.unlink()
    with BagWriter(bag) as writer:
        writer.add_topic("/odom", "nav_msgs/msg/Odometry")


@pytest.mark.parametrize(
    ("change", "codes"),
    [
        (None, {"info": 0, "check": 0, "rescue": 0, "convert": 0}),
        (lose_a_message, {"info": 1, "check": 1, "rescue": 1, "convert": 2}),
        (cut_to_nothing, {"info": 1, "check": 1, "rescue": 2, "convert": 2}),
        (cut_short, {"info": 0}),
        (without_messages, {"info": 0, "rescue": 0}),
    ],
)
def test_the_exit_code_states_whether_messages_are_known_to_be_lost(small_bag, change, codes):
    bag = small_bag()
    if change:
        change(bag)
    assert {command: main([command, str(bag)]) for command in codes} == codes


def test_of_several_bags_the_highest_exit_code_counts(small_bag, tmp_path, capsys):
    bag, nothing = small_bag(), tmp_path / "nothing.mcap"
    assert main(["convert", str(bag), "--compression", "zstd"]) == 0
    lose_a_message(bag)
    nothing.touch()
    assert main(["rescue", str(tmp_path / "small_mcap"), str(bag)]) == 1
    assert "messages lost: " in capsys.readouterr().out
    assert main(["rescue", str(tmp_path / "small_rescued"), str(nothing)]) == 2


def test_a_sound_bag_is_shown_and_checked(small_bag, capsys):
    bag = small_bag()
    main(["info", str(bag)])
    shown = capsys.readouterr().out
    assert shown.startswith(f"{bag}: 69 messages on 2 topics in 3.0 s\n")
    assert "/robot_pose  geometry_msgs/msg/PoseStamped           60  20.0\n" in shown
    main(["check", str(bag), "--require", "intent"])
    assert capsys.readouterr().out.endswith(f"sound: {bag}\n")
    main(["check", str(bag), "--json"])
    (values,) = json.loads(capsys.readouterr().out)
    assert (values["sound"], values["n_messages"]) == (True, 69)
    assert [topic["name"] for topic in values["topics"]] == ["/intent", "/robot_pose"]


def test_names_that_a_terminal_obeys_are_shown_with_their_escapes(tmp_path, messages, capsys):
    topic = "/pose\x1b[2J\u202e"
    write_bag(tmp_path / "bag", {topic: POSE}, [(topic, 10.0, messages.pose(10.0, 0.0, 1.0))])
    for words, code in (["info"], 0), (["check", "--require", "\x1b[31mscan"], 1):
        assert main([words[0], str(tmp_path / "bag"), *words[1:]]) == code
        shown = capsys.readouterr().out
        assert "/pose\\x1b[2J\\u202e" in shown
        assert shown.replace("\n", "").isprintable()
    assert "fault: topic \\x1b[31mscan has no message" in shown


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("info", "nowhere"), "bag nowhere must be a folder or a .mcap, .db3 or .bag file"),
        (("info", "x" * 300), f"cannot use {'x' * 300}: the name is too long; choose a shorter"),
        (("rescue", "a", "b", "--output", "c"), "--output must be left out for several bags"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(words, sentence, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"serd-bag: {sentence}")
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["bag.mcap", "bag.db3", "bag.bag"])
def test_a_file_without_a_readable_message_ends_info_and_check_with_1(tmp_path, name, capsys):
    (tmp_path / name).touch()
    for words in (["info"], ["info", "--json"], ["check"]):
        assert main([*words, str(tmp_path / name)]) == 1
    assert f"{tmp_path / name}: no message" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "unbuffered", "code"),
    [
        (["check", "--require", "/odom"], "", 1),
        (["check", "--require", "/odom"], "1", 0),  # it ends before it has checked anything
    ],
)
def test_a_reader_that_has_ended_is_no_error_and_changes_no_exit_code(
    small_bag, words, unbuffered, code
):
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "serd_bag.command.main", *words, small_bag()],
        stdout=writer,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )
    os.close(writer)
    assert (done.stderr, done.returncode) == (b"", code)
