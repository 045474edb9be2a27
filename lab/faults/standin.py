"""A stand-in for a robot with a driver, a localisation and Nav2, as a node of its own.

    python -m lab.faults.standin short_range --nav2-output cmd_vel --ros-args -r __ns:=/short_range

It drives in the built-in hallway. All stamps are of the wall clock, and no two topics share one;
`odom` and `scan` are best effort, and map -> odom is stamped ahead, as AMCL does. With
--nav2-output it serves navigate_to_pose with Nav2's usual tolerances, and publishes the commands
there. The topic `disturb` (std_msgs/String) holds the name of a fault (`lab.faults.faults`),
`second parent` for another parent of base_footprint on /tf, `home` to place the robot at its start,
or an empty text. `measured` (std_msgs/String) has as JSON what came of it: contacts of the outline,
how soon the robot stood, and `gap_s`, for how long the driver itself could publish nothing.
"""

import argparse
import array
import json
import math
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from lab.faults.faults import Channel, Messages, fault_named, intact, rays_ahead
from lab.faults.robots import PERSON_RADIUS_M, ROBOTS, robot_named
from serd_bag.formats.rosbag2.message_types import message_type, rosbags_types
from serd_ros.convert.motion import to_pose, to_quaternion, to_twist
from serd_ros.convert.stamp import to_header, to_stamp
from serd_ros.endpoints.topic_types import TF_TYPE, raw_message_class
from serd_sim.safety.motion import Pose, compose, motion_between, out_of_frame
from serd_sim.safety.reasons import Source
from serd_sim.safety.scan import Scan
from serd_sim.safety.world_guard import Message
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.world.command import STOP, Command, CommandGuard, limited_velocity

SECOND_PARENT = "second parent"
HOME: Pose = (3.5, 1.5, math.pi / 2)
STEP_S, TF_S, MEASURED_S = 0.01, 0.1, 0.1
#: Nav2's usual goal checker.
XY_TOLERANCE_M, YAW_TOLERANCE_RAD = 0.25, 0.25
_BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_RELIABLE = QoSProfile(depth=100)
_STANDING_MPS, _PERIOD_S = 0.02, 0.05
#: People wait where the robot is nearer than this (m), between surfaces.
_MAKE_WAY_M = 0.6


class Walkers:
    """One who walks along the hallway and one who walks across, and who wait for the robot."""

    def __init__(self) -> None:
        self._phase = np.zeros(2)
        self.place_m = self._places(self._phase)

    @staticmethod
    def _places(phase: np.ndarray) -> np.ndarray:
        there_m = 1.5 * np.sin(phase)
        return np.array([[1.2, 3.5 + there_m[0]], [3.0 + there_m[1], 6.0]])

    def walk(self, robot_m: Sequence[float], radius_m: float) -> None:
        phase = self._phase + math.tau / 12.0 * STEP_S
        wanted_m = self._places(phase)
        gap_m = np.hypot(*(wanted_m - robot_m).T) - radius_m - PERSON_RADIUS_M
        self._phase = np.where(gap_m > _MAKE_WAY_M, phase, self._phase)
        self.place_m = self._places(self._phase)


class Measurement:
    """Contacts, and what came of the last fault."""

    def __init__(self) -> None:
        self.contacts = {"wall": 0, "robot_on_person": 0, "person_on_robot": 0}
        self._touching: set[str] = set()
        self.fault, self._began_s, self._way_m = "", 0.0, 0.0
        self.times: dict[str, float | None] = {}

    def begin(self, fault: str, now_s: float) -> None:
        self.fault, self._began_s, self._way_m = fault, now_s, 0.0
        self.times = {"zero_s": None, "stood_s": None, "stood_m": None}

    def see(self, now_s: float, speed_mps: float, command: Command, touching: set[str]) -> None:
        for each in touching - self._touching:
            self.contacts[each] += 1
        self._touching = touching
        if not self.fault:
            return
        self._way_m += abs(speed_mps) * STEP_S
        since_s = now_s - self._began_s
        if self.times["zero_s"] is None and command == STOP:
            self.times["zero_s"] = since_s
        stands = abs(speed_mps) < _STANDING_MPS and self.times["zero_s"] is not None
        if self.times["stood_s"] is None and stands:
            self.times |= {"stood_s": since_s, "stood_m": self._way_m}


class Nav2:
    """Drives to the newest goal: turns to it, drives, turns to its heading.

    n_goals: that came. turned_rad: by which it turned in place at their ends.
    """

    def __init__(self, node: "Standin", output: str) -> None:
        # Not on PyPI, and without types.
        self._node, self._kind = node, import_module("nav2_msgs.action").NavigateToPose
        self._goal: tuple[Any, Future] | None = None
        self.n_goals, self.turned_rad = 0, 0.0
        self._publisher = node.create_publisher(Twist, output, 10)
        self._server = ActionServer(
            node, self._kind, "navigate_to_pose", self._drive,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            handle_accepted_callback=self._begin,
        )  # fmt: skip
        node.create_timer(_PERIOD_S, self._step)

    def _begin(self, handle: Any) -> None:
        """A new goal replaces the old one, which ends as aborted."""
        self._end("abort")
        self._goal, self.n_goals = (handle, Future()), self.n_goals + 1
        handle.execute()

    async def _drive(self, handle: Any) -> Any:
        assert self._goal is not None
        getattr(handle, await self._goal[1])()
        return self._kind.Result()

    def _end(self, how: str) -> None:
        if self._goal is not None:
            self._goal[1].set_result(how)
            self._goal = None

    def _step(self) -> None:
        if self._goal is None:
            return
        self._publisher.publish(to_twist(self._command(self._goal[0])))

    def _command(self, handle: Any) -> Command:
        robot, (x_m, y_m, yaw_rad) = self._node.robot, self._node.pose
        if handle.is_cancel_requested:
            self._end("canceled")
            return STOP
        place, turn = handle.request.pose.pose.position, handle.request.pose.pose.orientation
        east_m, north_m = place.x - x_m, place.y - y_m
        away_m = math.hypot(east_m, north_m)
        wanted_rad = math.atan2(north_m, east_m)
        if away_m <= XY_TOLERANCE_M:
            wanted_rad = 2.0 * math.atan2(turn.z, turn.w)
        error_rad = math.remainder(wanted_rad - yaw_rad, math.tau)
        if away_m <= XY_TOLERANCE_M and abs(error_rad) <= YAW_TOLERANCE_RAD:
            self._end("succeed")
            return STOP
        limit = robot.max_vel_theta_radps
        turns = away_m <= XY_TOLERANCE_M or abs(error_rad) > 0.6
        if away_m <= XY_TOLERANCE_M:
            self.turned_rad += abs(self._node.speeds[1]) * _PERIOD_S
        speed_mps = 0.0 if turns else min(robot.max_vel_x_mps, max(away_m, 0.1))
        return Command(speed_mps, min(max(2.0 * error_rad, -limit), limit))


class Standin(Node):  # type: ignore[misc]  # rclpy has no types
    """Moves in steps of 10 ms and publishes what is due."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("standin_robot")
        self.robot, self.rng = robot_named(options.robot), np.random.default_rng(options.seed)
        scenario = self.robot.scenario()
        self._body, self._limits = scenario.robot.outline, scenario.robot
        self._walls_m, self._raster = scenario.wall_segments_m, wall_distance_raster(scenario)
        self._outline_m = self._body.outline_m(0.02)
        self.pose: Pose = HOME
        #: Odometry begins at zero, and goes on where the robot is placed elsewhere.
        self._wheels: Pose = (0.0, 0.0, 0.0)
        self.speeds, self._shown_ahead = (0.0, 0.0), 0.0
        self._commands, self._measured = CommandGuard(0.5), Measurement()
        self._walkers = Walkers() if options.people else None
        self._channel: Channel = intact
        self._stepped_s = self._last_s = self.now_s()
        #: Its latest step and the longest time between two since the last message of `measured`.
        self._gap_s = 0.0
        self._due_s = dict.fromkeys(("odom", "tf", "scan", "measured"), 0.0)
        self._tf_type = raw_message_class(message_type(TF_TYPE))
        self._odom = self.create_publisher(Odometry, "odom", _BEST_EFFORT)
        self._scan = self.create_publisher(LaserScan, "scan", _BEST_EFFORT)
        self._tf = self.create_publisher(self._tf_type, "tf", _RELIABLE)
        self._tf_static = self.create_publisher(self._tf_type, "tf_static", _LATCHED)
        ahead = (self.robot.base_ahead_m, 0.0, 0.0)
        self._tf_static.publish(
            _transforms(
                0.0,
                ("base_footprint", "base_link", ahead),
                ("base_link", "laser", self.robot.mount),
            )
        )
        self._measurements = self.create_publisher(String, "measured", 10)
        self.create_subscription(Twist, options.cmd_vel, self._follow, 10)
        self.create_subscription(String, "disturb", self._disturb, 10)
        self._nav2 = Nav2(self, options.nav2_output) if options.nav2_output else None
        self.create_timer(STEP_S, self._step)

    def now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _follow(self, message: Twist) -> None:
        command = Command(message.linear.x, message.angular.z)
        self._commands.receive(command, self._stepped_s)  # one of after a step would stop in it

    def _disturb(self, message: String) -> None:
        name = message.data
        if name == "home":
            self.pose = HOME
        elif name != self._measured.fault:
            is_fault = name not in ("", SECOND_PARENT)
            self._channel = fault_named(name).make(self.rng, STEP_S) if is_fault else intact
            self._measured.begin(name, self.now_s())

    def _step(self) -> None:
        now_s = self.now_s()
        self._gap_s, self._last_s = max(self._gap_s, now_s - self._last_s), now_s
        while self._stepped_s + STEP_S <= now_s:
            self._stepped_s += STEP_S
            self._move(self._stepped_s)
        self._publish(self._channel(self._messages(now_s)))
        if self._is_due("measured", now_s, MEASURED_S):
            found: dict[str, Any] = {"pose": self.pose, "speed_mps": self.speeds[0]}
            found |= {"shown_ahead": self._shown_ahead}
            found |= {"fault": self._measured.fault, "gap_s": self._gap_s}
            self._gap_s = 0.0
            found |= {**self._measured.contacts, **self._measured.times}
            if self._nav2 is not None:
                found |= {"nav2_goals": self._nav2.n_goals, "turned_rad": self._nav2.turned_rad}
            self._measurements.publish(String(data=json.dumps(found)))

    def _move(self, now_s: float) -> None:
        command = self._commands.current(now_s)
        self.speeds = speed, turn = limited_velocity(command, *self.speeds, self._limits, STEP_S)
        step: Pose = (speed * STEP_S, 0.0, turn * STEP_S)
        self.pose, self._wheels = compose(self.pose, step), compose(self._wheels, step)
        if self._walkers is not None:
            self._walkers.walk(self.pose[:2], self._body.radius_m)
        self._measured.see(now_s, speed, command, self._touching())

    def _touching(self) -> set[str]:
        x_m, y_m = out_of_frame(self._outline_m, self.pose).T
        found = {"wall"} if self._raster.at(x_m, y_m).min() < 0.0 else set()
        if self._walkers is not None:
            gaps_m = self._body.gaps_m(np.array([self.pose]), self._walkers.place_m)
            if gaps_m.min() < PERSON_RADIUS_M:
                moves = abs(self.speeds[0]) > _STANDING_MPS
                found.add("robot_on_person" if moves else "person_on_robot")
        return found

    def _is_due(self, name: str, now_s: float, period_s: float) -> bool:
        if now_s < self._due_s[name]:
            return False
        self._due_s[name] = (
            max(now_s, self._due_s[name] + period_s) if self._due_s[name] else now_s + period_s
        )
        return True

    def _messages(self, now_s: float) -> Messages:
        """What the driver has made; no two of them have one stamp."""
        robot, found = self.robot, []
        if self._is_due("odom", now_s, 1.0 / robot.odom_hz):
            value: Any = self._wheels, self.speeds
            found.append(Message(Source.ODOMETRY, now_s, value))
        if self._is_due("tf", now_s, TF_S):
            found.append(Message(Source.POSE, now_s + 0.002, self.pose))
        if self._is_due("scan", now_s, 1.0 / self.rng.uniform(*robot.scan_hz)):
            people_m = np.zeros((0, 2)) if self._walkers is None else self._walkers.place_m
            stamp_s = now_s - robot.late_s
            back = (-self.speeds[0] * robot.late_s, 0.0, -self.speeds[1] * robot.late_s)
            ranges_m = robot.ranges_m(self._walls_m, compose(self.pose, back), people_m, self.rng)
            scan = Scan(stamp_s, ranges_m.astype(np.float32), robot.geometry, robot.mount)
            self._shown_ahead = float(scan.valid[rays_ahead(scan)].mean())
            found.append(Message(Source.SCAN, stamp_s, scan))
        return found

    def _publish(self, messages: Messages) -> None:
        for each in messages:
            if each.source is Source.ODOMETRY:
                self._publish_odometry(each.stamp_s, *each.value)
            elif each.source is Source.POSE:
                odom = compose(each.value, motion_between(self._wheels, (0.0, 0.0, 0.0)))
                self._tf.publish(_transforms(each.stamp_s + 0.6, ("map", "odom", odom)))
            else:
                self._publish_scan(each.value)

    def _publish_odometry(self, stamp_s: float, wheels: Pose, speeds: tuple[float, float]) -> None:
        message = Odometry(header=to_header("odom", stamp_s), child_frame_id="base_footprint")
        message.pose.pose, message.twist.twist = to_pose(wheels), to_twist(Command(*speeds))
        self._odom.publish(message)
        self._tf.publish(_transforms(stamp_s + 0.001, ("odom", "base_footprint", wheels)))
        if self._measured.fault == SECOND_PARENT:
            other = ("visual_odom", "base_footprint", wheels)
            self._tf.publish(_transforms(stamp_s + 0.001, other))

    def _publish_scan(self, scan: Scan) -> None:
        geometry, n_rays = scan.geometry, len(scan.ranges_m)
        message = LaserScan(
            header=to_header("laser", scan.stamp_s),
            angle_min=geometry.angle_min_rad, angle_increment=geometry.angle_increment_rad,
            angle_max=float(np.float32(geometry.angles_rad(n_rays)[-1])),
            range_min=geometry.range_min_m, range_max=geometry.range_max_m,
            ranges=array.array("f", scan.ranges_m.tobytes()),
        )  # fmt: skip
        if self.robot.intensities:
            message.intensities = array.array("f", [100.0] * n_rays)
        self._scan.publish(message)


def _transforms(time_s: float, *placed: tuple[str, str, Pose]) -> bytes:
    """A TFMessage as bytes, whose package has no wheel."""
    types, stamp = rosbags_types().types, to_stamp(time_s)
    at = types["builtin_interfaces/msg/Time"](stamp.sec, stamp.nanosec)
    found = []
    for parent, child, (x_m, y_m, yaw_rad) in placed:
        turn = to_quaternion(yaw_rad)
        moved = types["geometry_msgs/msg/Vector3"](x_m, y_m, 0.0)
        turned = types["geometry_msgs/msg/Quaternion"](turn.x, turn.y, turn.z, turn.w)
        header = types["std_msgs/msg/Header"](at, parent)
        transform = types["geometry_msgs/msg/Transform"](moved, turned)
        found.append(types["geometry_msgs/msg/TransformStamped"](header, child, transform))
    return bytes(rosbags_types().serialize_cdr(types[TF_TYPE](found), TF_TYPE))


def main() -> None:
    """Run until a signal ends it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("robot", choices=sorted(ROBOTS))
    parser.add_argument("--cmd-vel", default="cmd_vel")
    parser.add_argument("--nav2-output", default="")
    parser.add_argument("--people", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init(args=sys.argv)
    try:
        rclpy.spin(Standin(options))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
