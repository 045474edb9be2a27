"""The recorder as a process: every message it has received is in the bag, whatever ends it."""

import shlex
import signal

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.duration import Duration
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from serd_bag.command.rewrite import recover
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_ros.convert.diagnostics import ERROR
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos
from support.waiting import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.slow]
PATIENCE = Duration(seconds=PATIENCE_S)


class Recording:
    """A recorder of robot_pose, cmd_vel and /clock, and publishers of these topics."""

    def __init__(self, nodes, probe, report, environment, folder, largest_file_bytes):
        self.bag = folder / "bag"
        topics = ["robot_pose", "cmd_vel", "/clock"]
        parameters = {"output": str(self.bag), "topics": topics, "minimum_free_mb": 0.0}
        command = node_command("demo_recorder", parameters, {}, environment)
        if largest_file_bytes:
            limit = f"ulimit -f {largest_file_bytes // 1024}; exec {shlex.join(command)}"
            command = ["bash", "-c", limit]
        self.process = nodes.start(command, "demo_recorder")
        self._probe, self._report = probe, report
        self.poses = probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
        self.commands = probe.node.create_publisher(Twist, "cmd_vel", qos.STATE)
        self.clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
        publishers = self.poses, self.commands, self.clock
        probe.spin_until(lambda: all(each.get_subscription_count() for each in publishers))
        probe.spin_until(lambda: (self.bag / "bag_0.mcap").exists())
        probe.spin_until(lambda: report.n_messages == 0)

    def clock_at(self, time_s):
        """Publish on /clock, which may lose messages, until the recorder has received it."""

        def received():
            self.clock.publish(Clock(clock=to_stamp(time_s)))
            return self._report.time_s == time_s

        self._probe.spin_until(received)

    def wait_until_received(self):
        """Until the recorder has received all poses and commands."""
        assert all(each.wait_for_all_acked(PATIENCE) for each in (self.poses, self.commands))

    def pose_at(self, time_s):
        message = PoseStamped()
        message.header.stamp = to_stamp(time_s)
        self.poses.publish(message)

    def times_s(self, topic):
        messages = BagReader(self.bag).messages({topic})
        return [message.log_time_ns * 1e-9 for message in messages]

    def n_recorded(self):
        return sum(1 for _ in BagReader(self.bag, tolerant=True).messages({"/robot_pose"}))

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


@pytest.fixture
def record(nodes, probe, recorder_report, ros_env, tmp_path):
    return lambda largest_file_bytes=0: Recording(
        nodes, probe, recorder_report, ros_env, tmp_path, largest_file_bytes
    )


def test_messages_received_before_the_stop_signal_are_in_the_bag(record):
    recording = record()
    recording.process.send_signal(signal.SIGSTOP)  # as on a machine that is too busy to run it
    for number in range(1, 101):
        recording.pose_at(0.1 * number)
    recording.process.send_signal(signal.SIGTERM)
    recording.process.send_signal(signal.SIGCONT)
    assert recording.process.wait(PATIENCE_S) == 0
    assert recording.times_s("/robot_pose") == pytest.approx([0.1 * n for n in range(1, 101)])


def test_messages_without_a_stamp_get_that_of_the_clock_also_when_it_falls_back(record):
    recording = record()
    recording.pose_at(0.0)  # it has no stamp
    recording.wait_until_received()
    for time_s in (900.0, 5.0):
        recording.clock_at(time_s)
        recording.commands.publish(Twist())
        recording.pose_at(0.0)
        recording.wait_until_received()
    assert recording.end() == 0
    assert recording.times_s("/cmd_vel") == pytest.approx([900.0, 5.0])
    assert recording.times_s("/robot_pose") == pytest.approx([0.0, 900.0, 5.0])


def test_it_records_again_after_a_stop_request_in_the_middle_of_a_burst(record, probe):
    recording = record()
    stop, start = (
        probe.node.create_client(Trigger, name) for name in ("stop_recording", "start_recording")
    )
    probe.spin_until(lambda: stop.service_is_ready() and start.service_is_ready())

    def call(client):
        future = client.call_async(Trigger.Request())
        probe.spin_until(future.done)
        return future.result()

    assert not call(start).success
    recording.process.send_signal(signal.SIGSTOP)
    for number in range(1, 401):
        recording.pose_at(0.1 * number)
        if number == 200:
            stopped = stop.call_async(Trigger.Request())
    recording.process.send_signal(signal.SIGCONT)
    probe.spin_until(stopped.done)
    times_s = recording.times_s("/robot_pose")
    assert 200 <= len(times_s) <= 400
    assert times_s == pytest.approx([0.1 * n for n in range(1, len(times_s) + 1)])
    assert not call(stop).success
    assert call(start).message.endswith("bag-2")
    recording.pose_at(100.0)
    recording.wait_until_received()
    assert recording.end() == 0
    recording.bag = recording.bag.with_name("bag-2")
    assert recording.times_s("/robot_pose")[-1] == 100.0


def test_a_full_disk_is_reported_on_diagnostics_ends_the_node_and_keeps_the_bag(
    record, probe, nodes, tmp_path
):
    problems = []

    def take(message):
        problems.extend(each for each in message.status if each.level == ERROR)

    probe.node.create_subscription(DiagnosticArray, "diagnostics", take, qos.STATE)
    recording = record(largest_file_bytes=40 * 1024)
    time_s = 0.0

    def full():
        nonlocal time_s
        time_s += 0.1
        recording.pose_at(time_s)
        return recording.process.poll() is not None

    probe.spin_until(full)
    assert recording.process.returncode == 2
    assert "cannot write" in nodes.log_of("demo_recorder")
    probe.spin_until(lambda: problems)
    assert "cannot write" in problems[0].message
    n_kept = recording.n_recorded()
    assert n_kept > 50
    assert recover(recording.bag, tmp_path / "recovered").counts["/robot_pose"] == n_kept
