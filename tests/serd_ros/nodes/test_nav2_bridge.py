"""What the bridge to Nav2 sends, by a stand-in for Nav2's action servers and controller server."""

from types import SimpleNamespace

import pytest
from nav_msgs.msg import Path
from rclpy.parameter import Parameter
from rclpy.task import Future

from serd_ros.convert.motion import to_pose_stamped
from support.nav2_server import answered
from support.nodes_in_process import node_in_process

WAY = [(1.5, 1.5 + number, 0.0) for number in range(4)]


@pytest.fixture
def bridge(nav2_server):  # noqa: ARG001  the server is there before the bridge
    with node_in_process("nav2_bridge") as running:
        yield running


PARAMETERS = {
    "goal_checker_plugins": ["precise", "general"],
    "precise.xy_goal_tolerance": 0.1,
    "general.xy_goal_tolerance": 0.5,
}


class Controller:
    """Answers for parameters as a controller server with two goal checkers does."""

    def __init__(self):
        self.asked = []

    def service_is_ready(self):
        return True

    def call_async(self, request):
        found = [Parameter(name, value=PARAMETERS[name]) for name in request.names]
        self.asked.append((Future(), [each.get_parameter_value() for each in found]))
        return self.asked[-1][0]

    def answer(self):
        future, values = self.asked.pop()
        answered(future, SimpleNamespace(values=values))


def test_the_largest_tolerance_of_the_goal_checkers_counts_once_it_is_known(bridge):
    tolerance, controller = bridge.work._tolerance, Controller()
    tolerance._client = controller
    tolerance.look()
    controller.answer()
    controller.answer()
    tolerance.look()
    assert not controller.asked
    bridge.call_timers()
    assert bridge.health["xy_goal_tolerance"] == "0.5"
    bridge.assert_alive()


def test_the_plan_is_sent_without_the_cell_of_the_robot_and_its_rest_is_not_sent_again(
    bridge, nav2_server
):
    def receive(way):
        poses = [to_pose_stamped(pose, 1.0) for pose in way]
        bridge.receive("plan", Path(poses=poses))
        bridge.receive("waypoint", poses[-1])

    receive(WAY)
    nav2_server.answer()
    receive(WAY[1:])
    (goal,) = nav2_server.goals
    assert [each.pose.position.y for each in goal.poses] == [2.5, 3.5, 4.5]
    receive([(2.5, 1.5, 0.0), (3.5, 1.5, 0.0)])
    assert len(nav2_server.goals) == 2
    bridge.assert_alive()
