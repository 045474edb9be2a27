"""Topics of the robot's body and of movable obstacles, from a live simulator."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Imu, PointCloud2
from visualization_msgs.msg import MarkerArray

from serd_cli.processes.node_commands import node_command
from serd_ros.convert.markers import from_obstacle_markers
from serd_ros.endpoints import qos
from storage.yaml_config import model_yaml
from support.movable_obstacles import room

pytestmark = [pytest.mark.ros, pytest.mark.slow]
#: They enclose the start area on two sides, so that the robot meets a wall or one of them.
BEAMS = (
    {"name": "east", "outline_m": [[2.5, 0.1], [2.7, 0.1], [2.7, 2.9], [2.5, 2.9]], "mass_kg": 8.0},
    {
        "name": "north",
        "outline_m": [[0.1, 2.5], [2.4, 2.5], [2.4, 2.7], [0.1, 2.7]],
        "mass_kg": 8.0,
    },
)


def test_the_simulator_publishes_imu_bumper_and_outlines_of_obstacles(
    nodes, probe, ros_env, tmp_path
):
    scenario = tmp_path / "room.yaml"
    scenario.write_text(model_yaml(room(*BEAMS)))
    given = {"scenario": str(scenario), "seed": 1, "lockstep": False}
    imu, bumper, shown = [], [], []
    for kind, topic, taken in (
        (Imu, "imu", imu),
        (PointCloud2, "bumper", bumper),
        (MarkerArray, "markers/obstacles", shown),
    ):
        probe.node.create_subscription(kind, topic, taken.append, qos.STATE)
    commands = probe.node.create_publisher(Twist, "cmd_vel", qos.COMMAND)
    nodes.start(node_command("hallway_sim", given, {}, ros_env), "hallway_sim")

    def bumped():
        forward = Twist()
        forward.linear.x = 0.8
        commands.publish(forward)
        return bumper and imu and shown

    probe.spin_until(bumped)
    along, left, _, impulse = np.frombuffer(bytes(bumper[0].data), dtype=np.float32)[:4]
    assert math.hypot(along, left) == pytest.approx(0.25, abs=0.02)
    assert impulse > 0.0
    assert imu[0].linear_acceleration.z == pytest.approx(9.81, abs=0.1)
    outlines = from_obstacle_markers(shown[0])
    assert [len(outline) for outline in outlines] == [4, 4]
