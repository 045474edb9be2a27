"""`serd run` and `serd launch` as a user types them: exit codes, signals."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from serd_cli.processes.workspace import PROJECT, executables_of, find_command, ros_environment
from serd_ros.graph.graph import load_graph
from support.waiting import PATIENCE_S

SERD = str(Path(sys.executable).with_name("serd"))


def serd(*arguments, env, **options):
    return subprocess.run(
        [SERD, *arguments], env=env, capture_output=True, text=True, timeout=PATIENCE_S, **options
    )


@pytest.mark.ros
def test_serd_run_becomes_the_node_and_passes_signals_and_exit_code_on(ros_env, probe):
    command = [SERD, "run", "serd_ros", "local_planner", "--ros-args", "-r", "__ns:=/lab"]
    process = subprocess.Popen(command, env=ros_env)
    nodes = probe.node.get_node_names_and_namespaces
    command_line = Path(f"/proc/{process.pid}/cmdline")
    probe.spin_until(lambda: ("local_planner", "/lab") in nodes())
    probe.spin_until(lambda: "lib/serd_ros/local_planner" in command_line.read_text())
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) == 0


@pytest.mark.ros
def test_a_stack_interrupted_in_lock_step_ends_without_an_error(ros_env, tmp_path, quick_hallway):
    given = [f"output:={tmp_path / 'bag'}", f"scenario:={quick_hallway}", "people:=6"]
    command = [SERD, "launch", "demonstrate", *given]
    with subprocess.Popen(command, env=ros_env, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        lines = []
        for line in process.stderr:
            lines.append(line)
            if "episode 1 of 20: arrived" in line:
                break
        process.send_signal(signal.SIGINT)
        lines += process.stderr.readlines()
    assert process.returncode == 130
    assert "messages in" in lines[-1]
    errors = ("Traceback", "[FATAL]", "File")
    assert not [line for line in lines if any(each in line for each in errors)]


@pytest.mark.ros
def test_a_failing_node_ends_the_stack_with_its_error(ros_env, tmp_path):
    occupied = tmp_path / "bag"
    occupied.mkdir()
    (occupied / "old.mcap").write_text("not ours")
    done = serd("launch", "demonstrate", f"demo_recorder.output:={occupied}", env=ros_env)
    assert done.returncode == 2
    assert "demo_recorder ended with exit code 2" in done.stderr
    assert "must be new or empty" in done.stderr


@pytest.mark.slow
def test_an_archive_of_the_package_builds_and_its_nodes_run(tmp_path, ros_env, monkeypatch):
    workspace = tmp_path / "ros_ws"
    package = workspace / "src/serd_ros"
    shutil.copytree(PROJECT / "ros_ws/src/serd_ros", package, symlinks=True)
    assert not [path for path in package.rglob("*") if path.is_symlink()]
    environment = {**os.environ, "PATH": f"{Path(SERD).parent}:{os.environ['PATH']}"}
    build = ["colcon", "build"]
    subprocess.run(build, cwd=workspace, env=environment, check=True, capture_output=True)
    prefix = workspace / "install/serd_ros"
    assert (prefix / "share/ament_index/resource_index/packages/serd_ros").exists()
    launched = {path.name for path in (prefix / "share/serd_ros/launch").iterdir()}
    assert {"serd.launch.py", "navigate.launch.py", "simulation.launch.py"} < launched
    for folder in ("config", "rviz", "foxglove"):
        names = {path.name for path in (package / folder).iterdir() if path.is_file()}
        assert {path.name for path in (prefix / "share/serd_ros" / folder).iterdir()} == names
    assert executables_of(prefix, "serd_ros") == sorted(load_graph().nodes)
    monkeypatch.setenv("SERD_WORKSPACE", str(workspace))
    assert find_command("serd_ros", "guard", ros_environment({}))[0].startswith(str(prefix))
    wrong = ("--ros-args", "-p", "lockstep:=7")
    environment = {**ros_env, "SERD_WORKSPACE": str(workspace)}
    done = serd("run", "serd_ros", "guard", *wrong, env=environment)
    assert done.returncode == 2
    assert "lockstep" in done.stderr
