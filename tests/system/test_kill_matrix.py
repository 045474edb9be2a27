"""Nodes that are killed or stopped while the robot drives; `python -m benchmarks kill_matrix` has
every node of every stack.

Time is that of the stamps. The time that threads waited for a processor is added to each limit.
"""

import signal

import pytest

from benchmarks.faults.driven_stack import SOURCE, DrivenStack
from benchmarks.faults.launched_stack import LaunchedStack
from serd_ros.graph.graph import find_stack
from support.waiting import ProcessorWait

pytestmark = [pytest.mark.ros, pytest.mark.slow]
KILL, STOP = signal.SIGKILL, signal.SIGSTOP
#: The dead-man's switches take 0.5 s, braking from 1.2 m/s takes 0.48 s; a tick and the transport.
CHAIN_S = 0.5 + 1.2 / 2.5 + 0.2
#: A directive is recent for 1.5 periods of 2 s; then a cell of 1 m, diagonally, at walking pace.
SOURCE_S = 3.0 + 4.0


def faults(stack, node, numbers, ros_env, tmp_path, **given):
    """By signal: how the motion ends, by how much later, and whether a stopped node drives on."""
    with DrivenStack(stack, {"people": 0, **given}, ros_env, tmp_path) as driven:
        for number in numbers:
            driven.drive()
            waited = ProcessorWait()
            standing = driven.inject(node, number)
            late_s = waited.total_s
            yield standing, late_s, number == STOP and driven.resume(node)


@pytest.mark.parametrize(
    ("node", "numbers"),
    [("local_planner", (STOP, KILL)), ("teleop_mux", (KILL,)), ("teleop_page", (STOP, KILL))],
)
def test_the_robot_stands_after_a_node_of_teleoperation_died(node, numbers, ros_env, tmp_path):
    given = {"demo_recorder.output": str(tmp_path / "bag"), "port": 0}
    for standing, late_s, resumes in faults("teleop", node, numbers, ros_env, tmp_path, **given):
        assert standing.after_s <= CHAIN_S + late_s
        assert standing.distance_m <= 1.2 * (0.6 + late_s)
        assert not resumes  # the key that is still held counts after it was pressed anew


@pytest.mark.parametrize(
    ("node", "numbers", "limit_s"),
    [("local_planner", (KILL,), CHAIN_S), ("strategy", (STOP, KILL), SOURCE_S)],
)
def test_the_robot_stands_after_a_node_of_goto_died(
    node, numbers, limit_s, ros_env, tmp_path, save_model_of
):
    model = str(save_model_of())
    for standing, late_s, _ in faults("goto", node, numbers, ros_env, tmp_path, model=model):
        assert standing.after_s <= limit_s + late_s
        if node == "strategy":
            assert "local_planner: no recent waypoint" in standing.reports


def test_a_silent_source_of_intents_ends_the_motion_in_its_cell(ros_env, tmp_path):
    ((standing, late_s, _),) = faults("live", SOURCE, (KILL,), ros_env, tmp_path)
    assert standing.after_s <= SOURCE_S + late_s
    assert standing.distance_m <= 1.5 + 1.2 * late_s


def test_the_loss_of_the_world_stops_the_planner(ros_env, tmp_path):
    ((standing, *_),) = faults("live", "hallway_sim", (STOP,), ros_env, tmp_path)
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


def test_serd_launch_names_a_stopped_node_and_ends_all_nodes_when_one_is_killed(launched):
    stopped = launched.stop_node("hallway_sim")
    assert (stopped.named, stopped.n_left) == (True, len(find_stack("live").nodes))
    killed = launched.kill_node("local_planner")
    assert (killed.named, killed.n_left) == (True, 0)


def test_a_killed_serd_launch_leaves_no_node_behind(launched):
    assert launched.kill().n_left == 0
