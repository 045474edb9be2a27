"""`serd run` and `serd launch` as a user types them: exit codes, signals."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from serd_cli.processes.workspace import PROJECT, executables_of, find_command, ros_environment
from serd_files.table import load_episodes
from serd_ros.graph.graph import load_graph
from support.changed_scenario import changed_scenario
from support.waiting import PATIENCE_S, wait_until

SERD = str(Path(sys.executable).with_name("serd"))


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


@pytest.mark.slow
def test_archives_of_the_packages_build_and_their_nodes_run(tmp_path, ros_env, monkeypatch):
    workspace = tmp_path / "ros_ws"
    bringup = workspace / "src/serd_bringup"
    for name in ("serd_ros", "serd_bringup"):
        shutil.copytree(PROJECT / "ros_ws/src" / name, workspace / "src" / name, symlinks=True)
    assert not [path for path in (workspace / "src").rglob("*") if path.is_symlink()]
    environment = {**os.environ, "PATH": f"{Path(SERD).parent}:{os.environ['PATH']}"}
    build = ["colcon", "build"]
    subprocess.run(build, cwd=workspace, env=environment, check=True, capture_output=True)
    prefix = workspace / "install/serd_ros"
    assert (prefix / "share/ament_index/resource_index/packages/serd_ros").exists()
    share = workspace / "install/serd_bringup/share/serd_bringup"
    launched = {path.name for path in (share / "launch").iterdir()}
    assert {"serd.launch.py", "navigate.launch.py", "simulation.launch.py"} < launched
    for folder in ("config", "rviz", "foxglove"):
        names = {path.name for path in (bringup / folder).iterdir() if path.is_file()}
        assert {path.name for path in (share / folder).iterdir()} == names
    assert executables_of(prefix, "serd_ros") == sorted(load_graph().nodes)
    monkeypatch.setenv("SERD_WORKSPACE", str(workspace))
    assert find_command("serd_ros", "guard", ros_environment({}))[0].startswith(str(prefix))
    wrong = [SERD, "run", "serd_ros", "guard", "--ros-args", "-p", "lockstep:=7"]
    environment = {**ros_env, "SERD_WORKSPACE": str(workspace)}
    done = subprocess.run(wrong, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "lockstep" in done.stderr


SMALL = ["--demonstrations", "2", "--episodes", "1", "--seed", "5"]
#: So that an episode takes a moment.
NEAR = {
    "train: [[0, 0], [2, 0], [2, 3], [0, 3]]": "train: [[0, 8], [2, 8], [2, 11], [0, 11]]",
    "count: 24": "count: 6",
    "warm_up_s: 10.0": "warm_up_s: 1.0",
}


def processes_of(folder):
    """Ids and command lines of all processes that work in this folder."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_text().split("\0")
        except OSError:
            continue
        if any(str(folder) in word for word in words) and int(entry.name) != os.getpid():
            found[int(entry.name)] = " ".join(words)
    return found


def shared_memory_of(pids):
    """DDS segments these processes have mapped; /dev/shm itself also shows those of others."""
    maps = (Path(f"/proc/{pid}/maps").read_text() for pid in pids)
    return {line for text in maps for line in text.splitlines() if "/dev/shm/fast" in line}


def test_a_demo_ends_with_its_report_and_leaves_no_process(tmp_path):
    run, log_file = tmp_path / "demo_output/run-1", tmp_path / "demo.log"
    words = [SERD, "demo", *SMALL, "--scenario", changed_scenario(tmp_path, "hallway", NEAR)]
    with log_file.open("wb") as log:
        demo = subprocess.Popen(words, cwd=tmp_path, stdout=log, stderr=subprocess.STDOUT)

    def has_recorded():
        assert demo.poll() is None, log_file.read_text()
        return (run / "demonstrations/episodes.csv").exists()

    wait_until(has_recorded, seen=log_file.read_text)
    nodes = processes_of(tmp_path)
    assert len(nodes) >= 2
    assert shared_memory_of(nodes) == set()
    code, log = demo.wait(2 * PATIENCE_S), log_file.read_text()
    assert code == 0, log
    assert processes_of(tmp_path) == {}
    assert "2 demonstrations and 1 episode through ROS 2" in log
    assert "watch the drives at http://127.0.0.1:" in log
    assert log.splitlines()[-1] == f"report: {run / 'report.html'}"
    with AnyReader([run / "bag"]) as reader:
        assert reader.message_count > 1000
    (row,) = load_episodes(run / "navigation/episodes.csv")
    assert row.outcome == "arrived"
    page = (run / "report.html").read_text()
    assert len(re.findall(r"<figure", page)) == 5
    for name in ("bag/metadata.yaml", "model.yaml", "decisions.csv", "demo.yaml"):
        assert (run / name).is_file(), name
    assert json.loads((run / "foxglove.json").read_text())["configById"]
    assert 'href="foxglove.json"' in page
