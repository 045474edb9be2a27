"""Nodes that are killed or stopped while the robot drives.

Time is that of the stamps. The time that threads waited for a processor is added to each limit.
"""

import signal

import pytest

from serd_ros.graph.graph import find_stack
from support.driven_stack import SOURCE, DrivenStack
from support.launched_stack import LaunchedStack
from support.node_processes import NodeProcess
from support.waiting import ProcessorWait

pytestmark = [pytest.mark.ros, pytest.mark.slow]
KILL, STOP = signal.SIGKILL, signal.SIGSTOP
#: The dead-man's switches take 0.2 s, braking from 1.2 m/s 0.2 s; a tick and the transport.
CHAIN_S = 0.2 + 1.2 / 6.0 + 0.1
#: That of the lock by which the mux misses the front end of a person takes 0.5 s.
PERSON_S = CHAIN_S + 0.3
#: A waypoint is recent for 0.8 s, and the planner brakes with 2.5 m/s².
SOURCE_S = 0.8 + 1.2 / 2.5 + 0.2
#: An action ends in the next cell, 1.5 m ahead at most.
ACTION_S = 4.0


class ForkedStack(DrivenStack):
    """Its nodes start in a tenth of the time."""

    def _start(self, name, command):
        return NodeProcess(command, self._environment, self._folder / f"{name}.log")


def run(stack, node, number, ros_env, tmp_path, **given):
    """How the motion ends, and whether a stopped node drives on when it continues."""
    with ForkedStack(stack, {"people": 0, **given}, ros_env, tmp_path) as driven:
        driven.drive()
        waited = ProcessorWait()
        standing = driven.inject(node, number)
        late_s = waited.total_s
        resumes = number == STOP and driven.resume(node)
    return standing, late_s, resumes


@pytest.mark.parametrize(
    ("node", "number"),
    [
        ("local_planner", KILL),
        ("teleop_mux", KILL),
        ("teleop_page", KILL),
        ("local_planner", STOP),
        ("teleop_page", STOP),
    ],
)
def test_the_robot_stands_after_a_node_of_teleoperation_died(node, number, ros_env, tmp_path):
    given = {"demo_recorder.output": str(tmp_path / "bag"), "port": 0}
    standing, late_s, resumes = run("teleop", node, number, ros_env, tmp_path, **given)
    limit_s = PERSON_S if node == "teleop_page" else CHAIN_S
    assert standing.after_s <= limit_s + late_s
    assert standing.distance_m <= 1.2 * (limit_s + late_s)
    assert not resumes  # the key that is still held counts after it was pressed anew


@pytest.mark.parametrize(
    ("node", "number", "limit_s"),
    [("local_planner", KILL, CHAIN_S), ("strategy", KILL, SOURCE_S), ("strategy", STOP, SOURCE_S)],
)
def test_the_robot_stands_after_a_node_of_goto_died(
    node, number, limit_s, ros_env, tmp_path, save_model_of
):
    standing, late_s, _ = run("goto", node, number, ros_env, tmp_path, model=str(save_model_of()))
    assert standing.after_s <= limit_s + late_s
    if node == "strategy":
        assert "local_planner: no recent waypoint" in standing.reports


def test_a_silent_source_of_intents_ends_the_motion_in_its_cell(ros_env, tmp_path):
    standing, late_s, _ = run("live", SOURCE, KILL, ros_env, tmp_path)
    assert standing.after_s <= ACTION_S + late_s
    assert standing.distance_m <= 1.5 + 1.2 * late_s


def test_the_loss_of_the_world_stops_the_planner(ros_env, tmp_path):
    standing, _, _ = run("live", "hallway_sim", STOP, ros_env, tmp_path)
    assert any(each.startswith("local_planner: stale") for each in standing.reports)


@pytest.fixture
def launched(ros_env, tmp_path):
    stack = LaunchedStack("live", [], ros_env, tmp_path)
    try:
        stack.wait_until_running(find_stack("live").nodes, tmp_path)
        yield stack
    finally:
        if stack.process.poll() is None:
            stack.end()


def test_serd_launch_ends_all_nodes_when_one_is_killed(launched):
    ending = launched.kill_node("local_planner")
    assert (ending.named, ending.n_left) == (True, 0)


def test_serd_launch_names_a_node_that_is_stopped(launched):
    ending = launched.stop_node("hallway_sim")
    assert (ending.named, ending.n_left) == (True, len(find_stack("live").nodes))


def test_a_killed_serd_launch_leaves_no_node_behind(launched):
    assert launched.kill().n_left == 0
