"""One world per ROS domain: a second one is named, ends simulators and stops starts."""

import pytest
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock

from serd_cli.processes.node_commands import node_command
from serd_ros.endpoints import qos
from serd_ros.endpoints.world.worlds import FIX
from serd_ros.process import domain_check
from support.waiting import PATIENCE_S, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]


@pytest.fixture
def simulator(nodes, ros_env):
    """Starts a simulator in real time, with arguments."""

    def start(name, *arguments):
        command = node_command("hallway_sim", {"people": 0}, {}, ros_env)
        return nodes.start([*command, *arguments], name)

    return start


def test_a_second_simulator_ends_and_a_second_clock_ends_a_simulator_both_named(
    nodes, probe, simulator
):
    first = simulator("first")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("first"))
    assert simulator("second", "-r", "__ns:=/other").wait(PATIENCE_S) == 2
    sentence = "there must be one publisher of /clock, got 2: /hallway_sim, /other/hallway_sim; "
    assert nodes.log_of("second").splitlines()[-1] == f"hallway_sim: {sentence}{FIX}"
    assert "commands come from" not in nodes.log_of("second")
    assert first.poll() is None

    clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
    probe.spin_until(lambda: "got 2: /hallway_sim, /probe" in nodes.log_of("first"))
    assert first.poll() is None  # nothing has been published yet
    probe.spin_until(lambda: clock.publish(Clock()) or first.poll() is not None)
    assert first.wait() == 2
    assert "/hallway_sim, /probe; " + FIX in nodes.log_of("first").splitlines()[-1]


def test_a_start_is_refused_beside_a_publisher_of_poses_until_it_has_gone(
    probe, ros_env, monkeypatch, capsys
):
    monkeypatch.setattr(domain_check, "LONGEST_END_S", 0.5)
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_env["ROS_DOMAIN_ID"])
    poses = probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
    assert domain_check.main("/clock", "/robot_pose") == 2
    sentence = f"/robot_pose must have no publisher in ROS domain {ros_env['ROS_DOMAIN_ID']}"
    assert capsys.readouterr().out == (f"{sentence} before a simulator starts, got /probe; {FIX}\n")
    probe.node.destroy_publisher(poses)
    wait_until(lambda: not probe.node.count_publishers("robot_pose"))
    assert domain_check.main("/clock", "/robot_pose") == 0
