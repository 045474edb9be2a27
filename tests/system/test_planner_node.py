"""The node local_planner alone: its status, in Nav2's names, and its parameters."""

import math
import sys

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3Stamped
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from serd_core.grid.grid import Action
from serd_ros.convert.command import to_intent
from serd_ros.convert.diagnostics import values_of
from serd_ros.endpoints import qos
from serd_ros.endpoints.observation import ObservationPublisher
from support.observations import observation_at
from support.waiting import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.slow]


def test_a_robot_without_a_valid_pose_stands_and_the_planner_reports_the_reason(nodes, probe):
    """A localisation that fails gives poses that are not numbers; each of them is dropped."""
    nodes.start_stack("live", seed=2)["hallway_sim"].terminate()
    stale, dropped, commands = [], [], []

    def take(message):
        stale.extend(each for each in message.status if each.message == "stale")
        values = values_of(message, "local_planner: input") or {}
        dropped.extend(values.get("rejected.robot_pose", "").splitlines())

    probe.node.create_subscription(DiagnosticArray, "diagnostics", take, qos.STATE)
    probe.node.create_subscription(
        Twist, "cmd_vel_raw", lambda m: commands.append(m.linear.x), qos.COMMAND
    )
    observations = ObservationPublisher(probe.node)
    intents = probe.node.create_publisher(Vector3Stamped, "intent", qos.COMMAND)
    clock_s = [100.0]

    def seen_at(x_m, condition):
        def publish():
            clock_s[0] += 0.05
            observation = observation_at(x_m, 8.0, time_s=clock_s[0])
            observations.publish(observation, observation.pose)
            intents.publish(to_intent(Action.EAST, clock_s[0]))
            return condition()

        probe.spin_until(publish)

    seen_at(3.0, lambda: commands and commands[-1] > 0.0)
    seen_at(math.nan, lambda: stale and dropped and commands[-1] == 0.0)
    assert "position must be finite and at most 1e+06, got nan" in dropped[-1]
    seen_at(3.0, lambda: commands[-1] > 0.0)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("max_vel_x:=5.0", r"local_planner.max_vel_x must be at most robot.max_vel_x_mps (1.2)"),
        ("max_vel:=0.5", "local_planner has no parameter 'max_vel'; did you mean 'max_vel_x'?"),
    ],
)
def test_an_invalid_parameter_ends_the_node_with_an_error_message(nodes, given, sentence):
    command = [sys.executable, "-m", "serd_ros.process.executable", "local_planner"]
    command += ["--ros-args", "-p", given]
    assert nodes.start(command, "local_planner").wait(PATIENCE_S) == 2
    assert sentence in nodes.log_of("local_planner")


def test_parameters_can_be_read_and_are_fixed(nodes, probe):
    nodes.start_stack("live", seed=2, local_planner__max_vel_x=0.5)
    client = AsyncParameterClient(probe.node, "local_planner")
    probe.spin_until(client.services_are_ready)
    asked = client.get_parameters(["max_vel_x", "acc_lim_x", "controller_frequency", "sim_time"])
    wanted = client.set_parameters([Parameter("max_vel_x", value=0.6)])
    probe.spin_until(lambda: asked.done() and wanted.done())
    assert [each.double_value for each in asked.result().values] == [0.5, 2.5, 20.0, 1.4]
    (answer,) = wanted.result().results
    assert not answer.successful
    assert "max_vel_x is fixed while the node runs" in answer.reason
