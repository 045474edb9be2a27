"""The scripts of examples/ run as they are, each in a folder of its own."""

import os
import subprocess
import sys
from importlib.util import find_spec
from math import dist

import pytest
from geometry_msgs.msg import PoseStamped

from serd_cli.processes.workspace import node_command
from support.waiting import wait_until
from tests.system.conftest import nodes, probe, start_robot  # noqa: F401

PRINTED = {
    "frozen_lake.py": "converged: yes",
    "own_mdp.py": "wears by 0, 1, 2: [0.31 0.5  0.19]",
    "own_bag.py": "/report/report.html",
    "own_scenario.py": "arrived after",
    "own_feature.py": "west",
}
ROS = {"own_planner_node.py", "goal_by_action.py"}


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
    paths = os.pathsep.join(str(root / each) for each in (".", "sim", "bags"))
    done = subprocess.run(
        [sys.executable, str(root / "examples" / name), *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths, "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert PRINTED[name] in done.stdout


@pytest.mark.ros
@pytest.mark.slow
def test_a_node_drives_to_the_goal(nodes, probe, root, ros_env):
    world, poses = {"scenario": "corridor", "lockstep": False}, []
    for node, given in (("hallway_sim", {"people": 0}), ("guard", {"use_sim_time": True})):
        nodes.start(node_command(node, world | given, {}, ros_env), node)
    nodes.start([sys.executable, str(root / "examples/own_planner_node.py")], "planner")
    probe.subscribe(PoseStamped, "robot_pose", lambda each: poses.append(each.pose.position))
    probe.spin_until(lambda: poses)
    goal = poses[-1].x, poses[-1].y + 2.0
    probe.send_goal(*goal)
    probe.spin_until(lambda: dist(goal, (poses[-1].x, poses[-1].y)) < 0.35)


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.skipif(not (find_spec("nav2_msgs") and find_spec("serd_msgs")), reason="no messages")
def test_a_goal_by_action_is_driven_to_where_it_is_likely_in_time(
    nodes, start_robot, save_model_of, root
):
    start_robot()
    nodes.start_stack("robot", model=str(save_model_of()), strategy__patience_decisions=0)
    wait_until(lambda: "waiting for a goal" in nodes.log_of("strategy"))
    for deadline_s, end in (("1", "not sent: too unlikely"), ("60", "arrived")):
        words = str(root / "examples/goal_by_action.py"), "3.5", "4.5", deadline_s
        courier = nodes.start([sys.executable, *words], end)
        wait_until(lambda each=courier: each.poll() is not None)
        assert nodes.log_of(end).splitlines()[-1] == end
