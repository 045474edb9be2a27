"""The scripts of examples/ run as they are, each in a folder of its own."""

import os
import subprocess
import sys
from importlib.util import find_spec
from math import dist

import pytest
from geometry_msgs.msg import PoseStamped

from serd_cli.processes.workspace import node_command
from support.waiting import PATIENCE_S, wait_until
from tests.system.conftest import nodes, probe, start_robot  # noqa: F401

PRINTED = {
    "frozen_lake.py": "converged: yes",
    "own_mdp.py": "wears by 0, 1, 2: [0.31 0.5  0.19]",
    "own_bag.py": "/report/report.html",
    "own_scenario.py": "arrived after",
    "own_feature.py": "west",
}
ROS = {"own_planner_node.py", "goal_by_action.py"}


def started(root, folder, name, *words, environment):
    """A script of the examples as a process."""
    script = [sys.executable, str(root / "examples" / name), *words]
    paths = os.pathsep.join(str(root / each) for each in (".", "sim", "bags"))
    given = {**environment, "PYTHONPATH": paths, "MPLBACKEND": "agg"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    return subprocess.Popen(script, cwd=folder, env=given, **pipes)


def test_each_script_is_short_and_run_by_a_test(root):
    scripts = {path.name: path.read_text() for path in (root / "examples").glob("*.py")}
    assert scripts.keys() == {*PRINTED, *ROS}
    assert max(len(text.splitlines()) for text in scripts.values()) <= 60
    lake = scripts["frozen_lake.py"].splitlines()[1:]
    assert len(list(filter(None, lake))) == 10  # README and docs/library.md name the number


@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTED)
def test_a_script_runs(name, root, tmp_path):
    words = [str(root / "bags/data/hallway/training")] if name == "own_bag.py" else []
    script = started(root, tmp_path, name, *words, environment=os.environ)
    printed, _ = script.communicate()
    assert script.returncode == 0, printed
    assert PRINTED[name] in printed


@pytest.mark.ros
@pytest.mark.slow
def test_a_node_drives_to_the_goal(nodes, probe, root, tmp_path, ros_env):
    world = {"scenario": "corridor", "lockstep": False}
    for node, given in (("hallway_sim", {"people": 0}), ("guard", {"use_sim_time": True})):
        nodes.start(node_command(node, world | given, {}, ros_env), node)
    planner = started(root, tmp_path, "own_planner_node.py", environment=ros_env)
    poses = []
    try:
        probe.subscribe(PoseStamped, "robot_pose", lambda each: poses.append(each.pose.position))
        probe.spin_until(lambda: poses)
        goal = poses[-1].x, poses[-1].y + 2.0
        probe.send_goal(*goal)
        probe.spin_until(
            lambda: dist(goal, (poses[-1].x, poses[-1].y)) < 0.35, seen=lambda: poses[-1]
        )
    finally:
        planner.terminate()
        planner.communicate()


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.skipif(
    not (find_spec("nav2_msgs") and find_spec("serd_msgs")), reason="make interfaces"
)
def test_a_goal_by_action_arrives_in_time(
    nodes, start_robot, save_model_of, root, tmp_path, ros_env
):
    start_robot()
    nodes.start_stack("robot", model=str(save_model_of()), strategy__patience_decisions=0)
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))
    for deadline_s, end in (("1", "not sent: too unlikely"), ("60", "arrived")):
        words = "3.5", "4.5", deadline_s
        courier = started(root, tmp_path, "goal_by_action.py", *words, environment=ros_env)
        printed, _ = courier.communicate(timeout=PATIENCE_S)
        assert printed.splitlines()[-1] == end, printed
