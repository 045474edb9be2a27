"""The recorder as a process: nothing that came in is lost, whatever ends it."""

import shlex
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from bags.reader import BagReader
from bags.rewrite import recover
from serd_cli.node_commands import node_command
from serd_ros import qos
from serd_ros.convert.diagnostics import ERROR
from serd_ros.convert.stamp import to_stamp

pytestmark = [pytest.mark.ros, pytest.mark.slow]


class Recording:
    """A recorder of robot_pose, cmd_vel and /clock, and publishers that it listens to."""

    def __init__(self, nodes, probe, environment, folder, largest_file_bytes):
        self.bag = folder / "bag"
        topics = ["robot_pose", "cmd_vel", "/clock"]
        parameters = {"output": str(self.bag), "topics": topics, "minimum_free_mb": 0.0}
        command = node_command("demo_recorder", parameters, {}, environment)
        if largest_file_bytes:
            limit = f"ulimit -f {largest_file_bytes // 1024}; exec {shlex.join(command)}"
            command = ["bash", "-c", limit]
        self.process = nodes.start(command, "demo_recorder")
        self.probe = probe
        self.poses = probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
        self.commands = probe.node.create_publisher(Twist, "cmd_vel", qos.STATE)
        self.clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
        publishers = self.poses, self.commands, self.clock
        probe.spin_until(lambda: all(each.get_subscription_count() for each in publishers))
        probe.spin_until(lambda: (self.bag / "bag_0.mcap").exists())
        probe.spin_for(0.5)  # until it spins

    def pose_at(self, time_s):
        message = PoseStamped()
        message.header.stamp = to_stamp(time_s)
        self.poses.publish(message)

    def times_s(self, topic):
        found = BagReader(self.bag).messages({topic})
        return [message.log_time_ns * 1e-9 for message in found]

    def n_recorded(self):
        return sum(1 for _ in BagReader(self.bag, tolerant=True).messages({"/robot_pose"}))

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return self.process.wait(15)


@pytest.fixture
def record(nodes, probe, ros_env, tmp_path):
    return lambda largest_file_bytes=0: Recording(
        nodes, probe, ros_env, tmp_path, largest_file_bytes
    )


def test_what_came_in_before_it_was_told_to_stop_is_in_the_bag(record):
    recording = record()
    recording.process.send_signal(signal.SIGSTOP)  # a machine too busy to let it look
    for number in range(1, 101):
        recording.pose_at(0.1 * number)
    recording.process.send_signal(signal.SIGTERM)
    recording.process.send_signal(signal.SIGCONT)
    assert recording.process.wait(15) == 0
    assert recording.times_s("/robot_pose") == pytest.approx([0.1 * n for n in range(1, 101)])


def test_messages_without_a_stamp_get_the_clock_s_also_when_it_falls_back(record, probe):
    recording = record()
    recording.pose_at(0.0)  # never stamped
    for time_s in (900.0, 5.0):
        recording.clock.publish(Clock(clock=to_stamp(time_s)))
        probe.spin_for(0.3)
        recording.commands.publish(Twist())
        recording.pose_at(0.0)
        probe.spin_for(0.3)
    assert recording.end() == 0
    assert recording.times_s("/cmd_vel") == pytest.approx([900.0, 5.0])
    assert recording.times_s("/robot_pose") == pytest.approx([0.0, 900.0, 5.0])


def test_recording_starts_again_into_another_bag_also_when_nothing_came(record, probe):
    recording = record()
    clients = {
        name: probe.node.create_client(Trigger, name)
        for name in ("start_recording", "stop_recording")
    }

    def call(name):
        probe.spin_until(clients[name].service_is_ready)
        future = clients[name].call_async(Trigger.Request())
        probe.spin_until(future.done)
        return future.result()

    assert not call("start_recording").success
    assert call("stop_recording").success
    assert not call("stop_recording").success
    again = call("start_recording")
    assert again.success
    assert again.message.endswith("bag-2")
    assert recording.end() == 0


def test_a_disk_that_refuses_is_told_on_diagnostics_ends_the_node_and_keeps_the_bag(
    record, probe, nodes, tmp_path
):
    problems = []

    def hear(message):
        problems.extend(each for each in message.status if each.level == ERROR)

    probe.node.create_subscription(DiagnosticArray, "diagnostics", hear, qos.STATE)
    recording = record(largest_file_bytes=40 * 1024)
    time_s = 0.0

    def full():
        nonlocal time_s
        time_s += 0.1
        recording.pose_at(time_s)
        return recording.process.poll() is not None

    probe.spin_until(full)
    assert recording.process.returncode == 2
    assert "cannot write" in nodes.said("demo_recorder")
    probe.spin_until(lambda: problems)
    assert "cannot write" in problems[0].message
    n_kept = recording.n_recorded()
    assert n_kept > 50
    assert recover(recording.bag, tmp_path / "recovered").counts["/robot_pose"] == n_kept
