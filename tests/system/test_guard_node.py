"""The guard in the live stack: faults of its inputs, injected between the world and the guard."""

import math
import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import Bool

from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.pose import from_odometry
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_ros.graph.graph import find_stack
from support.waiting import ProcessorWait
from support.wheeled_robots import STOPPED_MPS

pytestmark = [pytest.mark.ros, pytest.mark.slow]
INPUTS = {
    "odom": Odometry,
    "robot_pose": PoseStamped,
    "pedestrians": PointCloud2,
    "scan": LaserScan,
}
SPEED_MPS = 0.3


class FaultyInputs:
    """Relays the inputs of the guard, drives a circle, and measures what reaches the robot."""

    def __init__(self, probe):
        self.probe = probe
        self.faults, self.held, self.late = {}, {}, []
        self.values = {}
        self.time_s = self.linear_mps = self.speed_mps = math.nan
        self.stamps_s = {}
        node = probe.node
        self.outputs = {
            topic: node.create_publisher(kind, f"{topic}_faulty", qos.STATE)
            for topic, kind in INPUTS.items()
        }
        for topic, kind in INPUTS.items():
            node.create_subscription(
                kind, topic, lambda m, topic=topic: self._relay(topic, m), qos.STATE
            )
        node.create_subscription(Twist, "cmd_vel", self._take, qos.STATE)
        node.create_subscription(DiagnosticArray, "diagnostics", self._on_diagnostics, qos.STATE)
        self.commands = node.create_publisher(Twist, "cmd_vel_raw", qos.COMMAND)
        self.override = node.create_publisher(Bool, "guard_override", qos.COMMAND)

    def _take(self, message):
        self.linear_mps = message.linear.x

    def _on_diagnostics(self, message):
        self.values = values_of(message, "guard") or self.values

    def _relay(self, topic, message):
        self.time_s = max(stamp_s(message.header.stamp), self.time_s if self.time_s > 0 else 0.0)
        if topic == "odom":
            self.speed_mps = from_odometry(message)[2][0]
        fault = self.faults.get(topic)
        if fault == "stops":
            return
        if fault == "late":
            self.late.append((topic, message))
            while self.late and stamp_s(self.late[0][1].header.stamp) <= self.time_s - 1.0:
                old, waiting = self.late.pop(0)
                self.outputs[old].publish(waiting)
            return
        if fault == "frozen":
            stamp = message.header.stamp
            message = self.held.setdefault(topic, message)
            message.header.stamp = stamp
        if fault == "nan":
            message.ranges = [math.nan] * len(message.ranges)
        self.stamps_s[topic] = stamp_s(message.header.stamp)
        self.outputs[topic].publish(message)

    def drive_until(self, condition, override=False):
        def turn():
            message = Twist()
            message.linear.x, message.angular.z = SPEED_MPS, 2.0
            self.commands.publish(message)
            if override:
                self.override.publish(Bool(data=True))
            return condition()

        self.probe.spin_until(turn)

    def until_it_moves(self):
        self.drive_until(lambda: self.linear_mps == SPEED_MPS and self.speed_mps > 0.2)

    def seconds_to_zero(self, faults):
        """Times from the last sound stamp to a zero command and to a standing robot."""
        self.probe.spin_all()
        self.faults, waited = faults, ProcessorWait()
        last_s = max(self.stamps_s[topic] for topic in faults)
        self.drive_until(lambda: self.linear_mps == 0.0)
        zero_s = self.time_s - last_s - waited.total_s
        self.drive_until(lambda: abs(self.speed_mps) < STOPPED_MPS)
        return zero_s, self.time_s - last_s - waited.total_s

    def heal(self):
        self.faults = {}
        self.held.clear()
        self.late.clear()


@pytest.fixture(scope="module")
def stack(running):
    faulty = {topic: f"{topic}_faulty" for topic in INPUTS}
    stack = find_stack("live").model_copy(
        update={"nodes": ("hallway_sim", "guard"), "remappings": {"guard": faulty}}
    )
    started = running.nodes.start_stack(stack, seed=2, hallway_sim__people=0)
    faulty_inputs = FaultyInputs(running.probe)
    faulty_inputs.guard = started["guard"]
    return faulty_inputs


@pytest.fixture
def inputs(stack):
    stack.heal()
    return stack


FAULTS = {
    "scan stops": ({"scan": "stops"}, "scan: stamp too old"),
    "scan frozen": ({"scan": "frozen"}, "scan: does not change"),
    "scan all NaN": ({"scan": "nan"}, "scan: too few valid rays"),
    "pose frozen": ({"robot_pose": "frozen"}, "robot_pose: does not change"),
    "all 1 s late": (dict.fromkeys(INPUTS, "late"), "scan: stamp too old"),
}


def test_faults_of_each_input_stand_the_robot_and_it_drives_on_afterwards(inputs):
    for name, (faults, reason) in FAULTS.items():
        inputs.until_it_moves()
        zero_s, stands_s = inputs.seconds_to_zero(faults)
        assert zero_s <= 0.25 + 0.1, name  # two periods: relay and odometry
        assert stands_s <= 0.25 + 0.1 + SPEED_MPS / 2.5 + 0.1, name
        inputs.drive_until(lambda reason=reason: reason in inputs.values["reasons"])
        assert inputs.values["action"] == "STOP"
        inputs.heal()


def test_a_held_override_drives_without_a_scan_and_is_reported(inputs):
    inputs.until_it_moves()
    inputs.seconds_to_zero({"scan": "stops"})
    inputs.drive_until(lambda: inputs.linear_mps == SPEED_MPS, override=True)
    inputs.drive_until(lambda: inputs.values["overridden"] == "True", override=True)
    assert "scan: stamp too old" in inputs.values["reasons"]
    inputs.drive_until(lambda: inputs.linear_mps == 0.0)
    inputs.drive_until(lambda: inputs.values["overridden"] == "False")


def test_commands_that_waited_while_the_guard_was_stopped_do_not_drive(inputs):
    inputs.until_it_moves()
    inputs.guard.send_signal(signal.SIGSTOP)
    stopped_s = inputs.time_s
    inputs.drive_until(lambda: inputs.time_s > stopped_s + 3.0)
    assert abs(inputs.speed_mps) < STOPPED_MPS
    # A command is as old as the machine's clock says, and a busy world may run faster for a while.
    silent_s, silent_wall_s, speeds = inputs.time_s, time.monotonic(), []
    inputs.probe.spin_until(
        lambda: inputs.time_s > silent_s + 0.5 and time.monotonic() > silent_wall_s + 0.5
    )
    inputs.values = {}
    inputs.guard.send_signal(signal.SIGCONT)
    inputs.probe.spin_until(lambda: speeds.append(inputs.speed_mps) or inputs.values)
    resumed_s = inputs.time_s
    inputs.probe.spin_until(
        lambda: speeds.append(inputs.speed_mps) or inputs.time_s > resumed_s + 1.0
    )
    # A command that the guard sent before may be sent again; the robot takes it for what it is.
    assert max(map(abs, speeds)) < STOPPED_MPS
    inputs.until_it_moves()
