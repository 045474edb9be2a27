"""What sourcing a workspace would set, read from colcon's own description of it."""

import sys

import pytest

from serd_cli.errors import UsageError
from serd_cli.processes.node_commands import find_command
from serd_cli.processes.workspace import LOOPBACK_PROFILE, ros_environment

MARKERS = "share/ament_index/resource_index/packages"


@pytest.fixture
def workspace(tmp_path, monkeypatch):
    """A built workspace with the package `toy` and its executable `talker`."""
    monkeypatch.setenv("SERD_WORKSPACE", str(tmp_path))
    prefix = tmp_path / "install/toy"
    (prefix / MARKERS).mkdir(parents=True)
    (prefix / MARKERS / "toy").touch()
    hooks = prefix / "share/toy/hook"
    hooks.mkdir(parents=True)
    (hooks / "a.dsv").write_text("prepend-non-duplicate;AMENT_PREFIX_PATH;\n")
    (hooks / "b.dsv").write_text("prepend-non-duplicate;PYTHONPATH;lib/python\nset;OTHER;1\n")
    talker = prefix / "lib/toy/talker"
    talker.parent.mkdir(parents=True)
    talker.write_text("#!/bin/sh\n")
    talker.chmod(0o755)
    (talker.parent / "notes.txt").write_text("not executable")
    return prefix


def test_hooks_are_prepended_once_however_often_it_is_done(workspace):
    once = ros_environment({"PYTHONPATH": "/mine"})
    assert once["PYTHONPATH"] == f"{workspace}/lib/python:/mine"
    assert once["AMENT_PREFIX_PATH"].split(":")[0] == str(workspace)
    assert "OTHER" not in once
    assert ros_environment(once) == once


def test_dds_stays_on_loopback_unless_the_user_says_otherwise(workspace):
    assert workspace.exists()
    assert ros_environment({})["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(LOOPBACK_PROFILE)
    own = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    assert "FASTRTPS_DEFAULT_PROFILES_FILE" not in ros_environment(own)


def test_an_executable_is_found_by_the_ament_index(workspace):
    found = find_command("toy", "talker", ros_environment({}))
    assert found == [str(workspace / "lib/toy/talker")]


def test_without_a_workspace_our_own_nodes_are_run_by_this_python(workspace):
    assert workspace.exists()
    found = find_command("serd_ros", "hallway_sim", ros_environment({}))
    assert found == [sys.executable, "-m", "serd_ros.process.executable", "hallway_sim"]


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
def test_a_wrong_name_gets_the_nearest_right_one(workspace, package, executable, sentence):
    assert workspace.exists()
    with pytest.raises(UsageError, match=sentence):
        find_command(package, executable, ros_environment({}))
