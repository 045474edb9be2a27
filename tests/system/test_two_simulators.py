"""One world per ROS domain: a second one is named, ends simulators and stops starts."""

import subprocess
import sys
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from serd_cli.processes.node_commands import node_command
from serd_ros.endpoints import qos
from serd_ros.endpoints.world.worlds import FIX
from support.waiting import PATIENCE_S, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
SERD = str(Path(sys.executable).with_name("serd"))


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
    """The first one is paused, so that its clock is silent; the second one ends all the same."""
    first = simulator("first")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("first"))
    pause = probe.node.create_client(SetBool, "pause")
    probe.spin_until(pause.service_is_ready)
    probe.spin_until(pause.call_async(SetBool.Request(data=True)).done)
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


def test_a_stack_with_a_simulator_does_not_start_beside_a_publisher_of_poses(
    probe, ros_env, tmp_path
):
    probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
    done = subprocess.run(
        [SERD, "launch", "live"],
        cwd=tmp_path,
        env=ros_env,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 2
    assert (
        f"/robot_pose must have no publisher in ROS domain {ros_env['ROS_DOMAIN_ID']} before a"
        f" simulator starts, got /probe; {FIX}"
    ) in " ".join(done.stderr.split())


def test_a_start_waits_until_another_publisher_has_gone(probe, ros_env):
    """The middleware names a killed process for a while."""
    words = [sys.executable, "-m", "serd_ros.process.domain_check", "/clock"]
    clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
    check = subprocess.Popen(words, env=ros_env)
    try:
        # Both participants of the check are here once their publishers are.
        wait_until(lambda: probe.node.count_publishers("serd_start_check_1"))
        assert check.poll() is None
        probe.node.destroy_publisher(clock)
        assert check.wait(PATIENCE_S) == 0
    finally:
        check.kill()
        check.wait()
