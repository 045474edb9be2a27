"""The node guard: whose commands it takes, and how old they are."""

import math
import time

import pytest
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool

from serd_ros.convert.motion import to_odometry, to_pose_stamped, to_twist
from serd_ros.convert.typed import from_guard_state
from serd_ros.errors import NodeError
from serd_ros.nodes import guard
from serd_sim.world.command import Command
from support.nodes_in_process import node_in_process
from support.observations import observation_at
from support.valid_messages import valid_message
from support.waiting import wait_until

INPUTS = "odom", "robot_pose", "pedestrians", "scan"
START = 100.0


@pytest.fixture
def running(monkeypatch):
    """A guard whose clock stands at START, with a fresh message of each input."""
    monkeypatch.setattr(guard.GuardNode, "now_s", lambda _: START)
    with node_in_process("guard") as node:
        node.node._guard.advance(START)
        for topic in INPUTS:
            node.receive(topic, valid_message(topic, START))
        yield node


def receive_command(running, age_s, linear_mps=0.3):
    """Deliver a command as an executor does that was sent some time ago."""
    (found,) = [each for each in running.node.subscriptions if "cmd_vel_raw" in each.topic_name]
    sent_ns = time.time_ns() - round(age_s * 1e9)
    info = {"received_timestamp": time.time_ns(), "source_timestamp": sent_ns}
    found.callback(to_twist(Command(linear_mps, 0.0)), info)
    return running.sent["cmd_vel"].linear.x if "cmd_vel" in running.sent else 0.0


def state(running):
    return from_guard_state(running.sent["guard_state"])


def test_a_guard_that_would_take_its_own_output_as_command_is_refused():
    sentence = "cmd_vel_raw and cmd_vel must be two topics, got .* for both; remap one of them only"
    for name in ("cmd_vel", "/cmd_vel"):
        remapped = node_in_process("guard", remappings=[f"cmd_vel_raw:={name}"])
        with pytest.raises(NodeError, match=sentence), remapped:
            pass
    with node_in_process("guard", remappings=["cmd_vel_raw:=nav_vel"]) as running:
        for _ in range(3):
            running.call_timers()
        assert not running.published["cmd_vel"]  # without a command
        running.assert_alive()


@pytest.mark.parametrize("topic", ["cmd_vel_raw", "cmd_vel"])
def test_a_second_publisher_of_commands_stands_the_robot_until_it_has_ended(running, topic):
    assert receive_command(running, 0.0) == pytest.approx(0.3)
    others = [running.node.create_publisher(Twist, topic, 1) for _ in range(2)]
    running.call_timers()
    assert receive_command(running, 0.0) == 0.0
    expected = {"action": "STOP", "reasons": f"{topic}: several publishers", "overridden": "False"}
    assert state(running) == expected
    for each in others:
        running.node.destroy_publisher(each)
    running.call_timers()
    assert receive_command(running, 0.0) == pytest.approx(0.3)
    running.assert_alive()


@pytest.mark.parametrize(("age_s", "speed_mps"), [(0.1, 0.3), (0.3, 0.0), (10.0, 0.0)])
def test_a_command_is_as_old_as_its_publisher_says(running, age_s, speed_mps):
    assert receive_command(running, age_s) == pytest.approx(speed_mps)


def test_a_command_that_was_sent_in_the_future_or_waited_behind_newer_ones_does_not_count(running):
    assert receive_command(running, -10.0) == 0.0
    sentence = "at most 0.2 s in the future, got 10.0 s"
    assert sentence in str(running.rejected["rejected.cmd_vel_raw"])
    (found,) = [each for each in running.node.subscriptions if "cmd_vel_raw" in each.topic_name]
    assert found.qos_profile.depth == 1
    running.assert_alive()


def test_what_a_lidar_seems_to_mean_by_zero_is_reported(running):
    scan = valid_message("scan", START + 0.1)
    scan.ranges = type(scan.ranges)("f", [9.0] * 100 + [0.0] * 160 + [9.0] * 100)
    for _ in range(10):
        running.receive("scan", scan)
    running.wait(1.0)
    receive_command(running, 0.0)
    assert "which seems to mean no return; set zero_is to free" in running.health["zero_ranges"]
    assert not math.isnan(float(running.health["age_s.scan"]))


class Drive:
    """A robot that drives north under a guard, whose inputs come every 50 ms, some with faults."""

    def __init__(self, running, monkeypatch):
        self.running, self.time_s, self.north_m = running, START, 6.5
        self.frozen_m, self.speed_mps = self.north_m, 0.3
        monkeypatch.setattr(guard.GuardNode, "now_s", lambda _: self.time_s)

    def tick(self, faults=(), *, override=False, commanded=True):
        """Speed after the messages of a period; faults: by topic."""
        self.time_s += 0.05
        self.north_m += 0.05 * self.speed_mps
        self.frozen_m = self.frozen_m if faults else self.north_m
        self.running.wait(0.05)
        for topic in INPUTS:
            fault = dict(faults).get(topic)
            if fault != "stops":
                self.running.receive(topic, self.message(topic, fault))
        if override:
            self.running.receive("guard_override", Bool(data=True))
        if commanded:
            receive_command(self.running, 0.0)
        self.running.call_timers()
        return self.running.sent["cmd_vel"].linear.x

    def message(self, topic, fault):
        frozen, time_s = fault == "frozen", self.time_s - (1.0 if fault == "late" else 0.0)
        north_m = self.frozen_m if frozen else self.north_m
        seen = observation_at(3.5, north_m, 1.571, time_s=time_s, speed_mps=self.speed_mps)
        if topic == "robot_pose":
            return to_pose_stamped(seen.pose, time_s)
        if topic == "odom":
            return to_odometry(seen, (self.north_m, 0.0, 0.0))
        message = valid_message(topic, time_s)
        if topic == "scan":
            ranges = [3.0 + 0.01 * (time_s % 1.0)] * len(message.ranges)
            message.ranges = type(message.ranges)("f", ranges)
        return message

    def until(self, speed_mps, faults=(), **options):
        """Seconds until the robot gets this speed."""
        since_s = self.time_s
        while self.tick(faults, **options) != pytest.approx(speed_mps):
            assert self.time_s < since_s + 3.0, self.running.health
        return self.time_s - since_s


@pytest.fixture
def drive(running, monkeypatch):
    found = Drive(running, monkeypatch)
    found.until(0.3)
    return found


FAULTS = {
    "scan stops": ({"scan": "stops"}, "scan: stamp too old"),
    "pose frozen": ({"robot_pose": "frozen"}, "robot_pose: does not change"),
    "all 1 s late": (dict.fromkeys(INPUTS, "late"), "scan: stamp too old"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_an_input_stands_the_robot_and_it_drives_on_afterwards(fault, drive):
    faults, reason = FAULTS[fault]
    assert drive.until(0.0, faults) <= 0.35
    assert state(drive.running)["action"] == "STOP"
    assert reason in state(drive.running)["reasons"]
    drive.until(0.3)
    drive.running.assert_alive()


def test_a_held_override_drives_without_a_scan_and_is_reported(drive):
    faults = {"scan": "stops"}
    drive.until(0.0, faults)
    drive.until(0.3, faults, override=True)
    assert state(drive.running)["overridden"] == "True"
    assert "scan: stamp too old" in state(drive.running)["reasons"]
    drive.until(0.0, faults)
    assert state(drive.running)["overridden"] == "False"


def test_a_command_from_before_a_pause_of_the_process_does_not_drive(drive):
    drive.running.wait(0.6)
    assert drive.tick(commanded=False) == 0.0
    drive.until(0.3)


def test_limits_become_stricter_while_the_robot_drives_and_looser_while_it_stands(drive):
    result = drive.running.set(max_vel_x=0.1, collision_margin=0.05)
    assert result.successful, result.reason
    assert drive.until(0.1) < 0.1
    assert "cmd_vel_raw: faster than allowed" in state(drive.running)["reasons"]
    for wanted in ({"max_vel_x": 0.2}, {"radius": 0.1}, {"max_vel_x": 0.05, "min_points": 3}):
        refused = drive.running.set(**wanted)
        assert "may allow more only while the robot stands" in refused.reason
        assert "which shows 0.30 m/s" in refused.reason
    assert drive.running.node.get_parameter("max_vel_x").value == 0.1
    drive.speed_mps = 0.0
    drive.until(0.1)
    assert drive.running.set(max_vel_x=0.2, radius=0.1).successful
    drive.speed_mps = 0.3
    drive.until(0.2)
    drive.running.assert_alive()


def test_a_footprint_that_holds_the_one_before_is_taken_while_the_robot_drives(drive):
    box = "[[{0}, 0.3], [-{0}, 0.3], [-{0}, -0.3], [{0}, -0.3]]"
    assert drive.running.set(footprint=box.format(0.5)).successful
    assert drive.running.set(footprint=box.format(0.6)).successful
    assert "footprint may allow more" in drive.running.set(footprint=box.format(0.5)).reason
    refused = drive.running.set(footprint="[[0.5, 0.3]]")
    assert refused.reason.startswith("parameter of guard: footprint must be corners as in")
    assert drive.running.node.get_parameter("footprint").value == box.format(0.6)


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        ({"slowdown_ratio": 1.5}, "slowdown_ratio must be less than or equal to 1, got 1.5"),
        ({"source_timeout": 0.1}, "slowdown_timeout must be less than source_timeout"),
        ({"acc_lim_x": 1.0}, "acc_lim_x is fixed while guard runs; end the node and start it with"),
        ({"max_vel_x": math.nan}, "max_vel_x must be"),
    ],
)
def test_what_a_running_guard_cannot_take_is_refused_with_the_reason(running, wanted, sentence):
    refused = running.set(**wanted)
    assert not refused.successful
    assert sentence in refused.reason
    running.assert_alive()


def test_what_has_arrived_counts_before_an_input_is_too_old(running, monkeypatch):
    """A process that had to wait for a processor finds a command before the inputs beside it."""
    later_s = START + 2.0  # a session of its own, with no rate yet
    monkeypatch.setattr(guard.GuardNode, "now_s", lambda _: later_s)
    assert receive_command(running, 0.0) == 0.0
    assert "odom: stamp too old" in state(running)["reasons"]
    for topic in INPUTS:
        (found,) = running.subscriptions(topic)
        publisher = running.node.create_publisher(found.msg_type, topic, 10)
        wait_until(publisher.get_subscription_count)
        publisher.publish(valid_message(topic, later_s))
    wait_until(lambda: receive_command(running, 0.0) == pytest.approx(0.3))
    running.assert_alive()
