"""`serd-bag`, the command without ROS."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from serd_bag.command.commands import EXIT_CODES
from serd_bag.command.main import main
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from support.bag_messages import POSE
from support.damaged_files import write_flipped
from support.mcap_files import CONTENTS, Feature, mcap_file


def cut_short(bag):
    (bag / "metadata.yaml").unlink()
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    return bag


def test_a_sound_bag_is_shown_and_checked(small_bag, capsys):
    bag = small_bag()
    assert main(["info", str(bag)]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{bag}: 69 messages on 2 topics in 3.0 s\n")
    assert "/robot_pose  geometry_msgs/msg/PoseStamped" in shown
    assert main(["check", str(bag), "--require", "intent"]) == 0
    assert capsys.readouterr().out.endswith(f"sound: {bag}\n")
    assert main(["check", str(bag), "--require", "scan"]) == 1
    assert "fault: topic scan has no message\n" in capsys.readouterr().out


def test_names_that_a_terminal_obeys_are_shown_with_their_escapes(tmp_path, messages, capsys):
    topic = "/pose\x1b[2J\u202e"
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(topic, POSE)
        writer.write(topic, messages.pose(10.0, 0.0, 1.0), 10**10)
    for words in (["info"], ["check"], ["check", "--require", "\x1b[31mscan"]):
        main([words[0], str(tmp_path / "bag"), *words[1:]])
        shown = capsys.readouterr().out
        assert "/pose\\x1b[2J\\u202e" in shown
        assert shown.replace("\n", "").isprintable()
    assert "fault: topic \\x1b[31mscan has no message" in shown


def test_the_values_of_a_check_are_json(small_bag, capsys):
    bag = small_bag()
    assert main(["check", str(bag), "--json"]) == 0
    (values,) = json.loads(capsys.readouterr().out)
    assert (values["sound"], values["n_messages"]) == (True, 69)
    assert [topic["name"] for topic in values["topics"]] == ["/intent", "/robot_pose"]


def test_a_damaged_bag_is_recovered_and_converted(small_bag, capsys, tmp_path):
    bag = cut_short(small_bag())
    assert main(["check", str(bag)]) == 1
    assert main(["recover", str(bag)]) == 0
    assert "messages lost: " in capsys.readouterr().out
    recovered = bag.with_name("small_recovered")
    n_messages = len(list(BagReader(recovered).messages()))
    assert 0 < n_messages < 69
    target = tmp_path / "compressed"
    assert main(["convert", str(recovered), "--output", str(target), "--compression", "zstd"]) == 0
    assert len(list(BagReader(target).messages())) == n_messages


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("info", "nowhere"), "bag nowhere must be a folder or a .mcap, .db3 or .bag file"),
        (("info", "x" * 300), f"cannot use {'x' * 300}: the name is too long; choose a shorter"),
        (("recover", "a", "b", "--output", "c"), "--output must be left out for several bags"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(words, sentence, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"serd-bag: {sentence}")
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", ["bag.mcap", "bag.db3", "bag.bag"])
def test_info_of_a_file_without_a_readable_message_ends_with_1_as_check_does(
    tmp_path, name, capsys
):
    (tmp_path / name).touch()
    for words in (["info"], ["info", "--json"], ["check"]):
        assert main([*words, str(tmp_path / name)]) == 1
    assert f"{tmp_path / name}: no message" in capsys.readouterr().out


def lose_a_message(bag):
    """Flip a bit of a chunk; without metadata.yaml `info` reads the bag."""
    (bag / "metadata.yaml").unlink()
    (file,) = bag.glob("*.mcap")
    content = file.read_bytes()
    write_flipped(file, content, len(content) // 2)
    return bag


def without_messages(bag):
    shutil.rmtree(bag)
    with BagWriter(bag) as writer:
        writer.add_topic("/odom", "nav_msgs/msg/Odometry")


def cut_to_nothing(bag):
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:20])
    return bag


@pytest.mark.parametrize(
    ("change", "codes"),
    [
        (None, {"info": 0, "check": 0, "recover": 0, "convert": 0}),
        (lose_a_message, {"info": 1, "check": 1, "recover": 1, "convert": 2}),
        (cut_to_nothing, {"info": 1, "check": 1, "recover": 3, "convert": 2}),
        (cut_short, {"info": 0}),
        (without_messages, {"info": 0, "recover": 0}),
    ],
)
def test_the_exit_code_states_whether_messages_are_known_to_be_lost(small_bag, change, codes):
    bag = small_bag()
    if change:
        change(bag)
    assert {command: main([command, str(bag)]) for command in codes} == codes


def test_of_several_bags_the_highest_exit_code_counts(small_bag, tmp_path, capsys):
    lost, whole = lose_a_message(small_bag()), tmp_path / "whole.mcap"
    whole.write_bytes(mcap_file(CONTENTS["OneMessage"], Feature.NONE))
    nothing = tmp_path / "nothing.mcap"
    nothing.touch()
    assert main(["recover", str(whole), str(lost)]) == 1
    assert "messages lost: " in capsys.readouterr().out
    assert main(["recover", str(lost.with_name("small_recovered")), str(nothing)]) == 3


def test_the_help_states_all_exit_codes(capsys):
    for words in (["--help"], ["recover", "--help"]):
        with pytest.raises(SystemExit):
            main(words)
        shown = " ".join(capsys.readouterr().out.split())
        assert EXIT_CODES in shown


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="a device that is always full")
def test_a_full_disk_under_the_output_is_one_line(small_bag):
    with FULL.open("w") as full:
        done = run("info", small_bag(), stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    sentence = "cannot write the output: the disk is full; free some space or choose another folder"
    assert done.stderr == f"serd-bag: {sentence}\n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    ("words", "code"),
    [(["info"], 0), (["check"], 0), (["check", "--require", "/odom"], 1), (["--help"], 0)],
)
def test_a_reader_that_has_ended_is_no_error_and_changes_no_exit_code(
    small_bag, words, code, unbuffered
):
    reader, writer = os.pipe()
    os.close(reader)
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    streams = {"stdout": writer, "stderr": subprocess.PIPE, "env": environment}
    done = run(*words, small_bag(), **streams)
    os.close(writer)
    assert done.stderr == b""
    # Without a buffer, the command ends before it has checked anything.
    assert done.returncode == (0 if unbuffered else code)


def run(*words, **streams):
    """The command in a process of its own."""
    return subprocess.run([sys.executable, "-m", "serd_bag.command.main", *words], **streams)


@pytest.mark.parametrize("columns", [200, 80, 50])
def test_names_are_folded_to_the_width_of_the_terminal(small_bag, capsys, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main(["info", str(small_bag())]) == 0
    _, *table = capsys.readouterr().out.splitlines()
    assert max(map(len, table)) <= columns
    assert any("geometry_msgs/msg/PoseStamped" in line for line in table) == (columns >= 80)
    assert any("geometry_msgs/msg/Pos" in line for line in table)
