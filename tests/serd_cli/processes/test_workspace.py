"""Nodes are found in a workspace, and get parameters that ROS can hold."""

import sys

import pytest

from serd_bag.errors import FileError
from serd_cli.errors import UsageError
from serd_cli.processes.workspace import (
    find_command,
    parse_assignment,
    ros_environment,
)
from serd_ros.graph.graph import LOOPBACK_PROFILE


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("seed:=3", 3),
        ("rate:=1e-3", 1e-3),
        ("lockstep:=false", False),
        ("topics:=[odom, '/imu:sensor_msgs/msg/Imu']", ["odom", "/imu:sensor_msgs/msg/Imu"]),
        ("goal:=''", ""),
        ("time:=1:30", "1:30"),
    ],
)
def test_an_assignment_gives_the_name_and_the_value(text, value):
    assert parse_assignment(text) == (text.partition(":=")[0], value)


NO_YAML, NO_VALUE = r"parameter 'seed'.* not valid YAML", "'seed' must be true or false, a 64-bit"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        *((f"seed:={value}", NO_YAML) for value in ("!!float ''", "[1", "!!timestamp x", "*a")),
        *((f"seed:={value}", NO_VALUE) for value in ("{a: 1}", "[[1]]", "null", "", '"a\\0"')),
        (f"seed:={2**63}", NO_VALUE),
        *((text, "must be written name:=value") for text in ("seed", ":=3", "seed=3")),
    ],
)
def test_what_no_parameter_can_hold_is_refused(text, sentence):
    with pytest.raises((FileError, UsageError), match=sentence):
        parse_assignment(text)


@pytest.fixture
def workspace(tmp_path, monkeypatch):
    """A built workspace with the package `toy` and its executable `talker`."""
    monkeypatch.setenv("SERD_WORKSPACE", str(tmp_path))
    prefix = tmp_path / "install/toy"
    for name, text in {
        "share/ament_index/resource_index/packages/toy": "",
        "share/toy/hook/a.dsv": "prepend-non-duplicate;AMENT_PREFIX_PATH;\n",
        "share/toy/hook/b.dsv": "prepend-non-duplicate;PYTHONPATH;lib/python\nset;OTHER;1\n",
        "lib/toy/talker": "#!/bin/sh\n",
        "lib/toy/notes.txt": "not executable",
    }.items():
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        (prefix / name).write_text(text)
    (prefix / "lib/toy/talker").chmod(0o755)
    return prefix


def test_hooks_are_prepended_once_however_often_it_is_done(workspace):
    once = ros_environment({"PYTHONPATH": "/mine"})
    assert once["PYTHONPATH"] == f"{workspace}/lib/python:/mine"
    assert once["AMENT_PREFIX_PATH"].split(":")[0] == str(workspace)
    assert "OTHER" not in once
    assert ros_environment(once) == once


def test_dds_stays_on_loopback_unless_the_user_says_otherwise():
    assert ros_environment({})["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(LOOPBACK_PROFILE)
    own = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    assert "FASTRTPS_DEFAULT_PROFILES_FILE" not in ros_environment(own)


def test_an_executable_is_found_by_the_ament_index_and_ours_also_without_a_workspace(workspace):
    environment = ros_environment({})
    assert find_command("toy", "talker", environment) == [str(workspace / "lib/toy/talker")]
    ours = [sys.executable, "-m", "serd_ros.process.executable", "hallway_sim"]
    assert find_command("serd_ros", "hallway_sim", environment) == ours


@pytest.mark.usefixtures("workspace")
@pytest.mark.parametrize(
    ("package", "executable", "sentence"),
    [
        ("toi", "talker", "package 'toi' is not installed; did you mean 'toy'"),
        ("toy", "talkr", "has no executable 'talkr'; did you mean 'talker'"),
        ("serd_rso", "hallway_sim", "package 'serd_rso' is not installed; did you mean 'serd_ros'"),
        ("serd_ros", "halway_sim", "has no executable 'halway_sim'; did you mean 'hallway_sim'"),
        ("toy", "notes.txt", "has no executable 'notes.txt'; choose from talker"),
    ],
)
def test_a_wrong_name_gets_the_nearest_right_one(package, executable, sentence):
    with pytest.raises(UsageError, match=sentence):
        find_command(package, executable, ros_environment({}))
