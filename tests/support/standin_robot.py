"""A stand-in for a robot with a driver, AMCL and Nav2, as a process of its own.

    PYTHONPATH=tests python tests/support/standin_robot.py --period 0.1 --follow nav2

All stamps are of the wall clock, and no two topics share one. `odom` and `scan` are best effort,
and map -> odom is stamped ahead, as AMCL does. Odometry begins at zero, and the lidar is turned by
a quarter. The robot follows `cmd_vel`, or goals of navigate_to_pose including their heading, as
Nav2's goal checker requires.
It prints `goal N` for each goal, with how far it had to turn in place at its end. With --people it
is in the built-in hallway, among the `walkers`. The topic `disturb` (std_msgs/String) makes its /tf
wrong: "jump" moves map -> odom by 1.5 m, "second parent" publishes another one of base_footprint,
and an empty text ends both.
"""

import argparse
import array
import math
import random

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from serd_bag.formats.rosbag2.message_types import message_type
from serd_ros.convert.motion import to_pose, to_twist
from serd_ros.convert.stamp import to_header
from serd_ros.endpoints.topic_types import raw_message_class
from serd_sim.robot.sensors import Lidar
from serd_sim.safety.motion import compose, motion_between
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import People
from support.bag_messages import TF, Messages

MADE = Messages()
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE = QoSProfile(depth=100)
STEP_S = 0.02
SPEED_MPS, TURN_RADPS = 0.6, 1.5
XY_TOLERANCE_M, YAW_TOLERANCE_RAD = 0.1, 0.25
N_RAYS, WALL_M = 360, 3.0
MOUNT = -0.04, 0.0, math.pi / 2
HALLWAY = load_scenario("hallway")


class StandIn(Node):
    """Moves in steps of 20 ms and publishes every period."""

    def __init__(self, options):
        super().__init__("standin_robot")
        self.pose = [*options.start, math.pi / 2]
        self.start, self.moved_s = tuple(self.pose), self.now_s()
        self.command, self.commanded_s = (0.0, 0.0), 0.0
        self.speeds, self.goal, self.n_goals = (0.0, 0.0), None, 0
        self.turned_rad = 0.0
        tf = raw_message_class(message_type(TF))
        self.odom = self.create_publisher(Odometry, "odom", BEST_EFFORT)
        self.scan = self.create_publisher(LaserScan, "scan", BEST_EFFORT)
        self.tf = self.create_publisher(tf, "tf", RELIABLE)
        self.tf_static = self.create_publisher(tf, "tf_static", LATCHED)
        footprint = ("base_footprint", "base_link", (0.0, 0.0, 0.0), 0.0)
        self.tf_static.publish(MADE.transforms(footprint, ("base_link", "laser", MOUNT, 0.0)))
        self.lidar = None
        if options.people:
            self.lidar = Lidar(HALLWAY.lidar, HALLWAY.wall_segments_m, 0.25)
        if options.follow == "nav2":
            from nav2_msgs.action import NavigateToPose

            self.kind = NavigateToPose
            self.server = ActionServer(
                self, NavigateToPose, "navigate_to_pose", self.drive,
                cancel_callback=lambda _: CancelResponse.ACCEPT,
                handle_accepted_callback=self.begin,
            )  # fmt: skip
        else:
            self.create_subscription(Twist, "cmd_vel", self.follow, 10)
        self.disturbance = ""
        self.create_subscription(String, "disturb", self.disturb, 10)
        self.create_timer(STEP_S, self.move)
        self.create_timer(options.period, self.publish)

    def now_s(self):
        return self.get_clock().now().nanoseconds * 1e-9

    def disturb(self, message):
        self.disturbance = message.data

    def follow(self, message):
        self.command, self.commanded_s = (message.linear.x, message.angular.z), self.now_s()

    def begin(self, handle):
        """A new goal replaces the old one, which ends as aborted."""
        if self.goal is not None:
            self.goal[1].set_result("abort")
        self.turned_rad, self.n_goals = 0.0, self.n_goals + 1
        self.goal = handle, Future()
        handle.execute()

    async def drive(self, handle):
        ending = self.goal[1]
        getattr(handle, await ending)()
        return self.kind.Result()

    def towards_goal(self):
        """Speeds to the goal of Nav2: turn, drive, turn to its heading."""
        handle, ending = self.goal
        if handle.is_cancel_requested:
            self.goal = None
            ending.set_result("canceled")
            return 0.0, 0.0
        place, turn = handle.request.pose.pose.position, handle.request.pose.pose.orientation
        east, north = place.x - self.pose[0], place.y - self.pose[1]
        away_m = math.hypot(east, north)
        if away_m > XY_TOLERANCE_M:
            error = math.remainder(math.atan2(north, east) - self.pose[2], math.tau)
            turn_radps = max(-TURN_RADPS, min(TURN_RADPS, 3.0 * error))
            return (SPEED_MPS if abs(error) < 0.5 else 0.0), turn_radps
        error = math.remainder(2 * math.atan2(turn.z, turn.w) - self.pose[2], math.tau)
        if abs(error) > YAW_TOLERANCE_RAD:
            self.turned_rad += TURN_RADPS * STEP_S
            return 0.0, math.copysign(TURN_RADPS, error)
        print(f"goal {self.n_goals} turned {self.turned_rad:.2f}", flush=True)
        self.goal = None
        ending.set_result("succeed")
        return 0.0, 0.0

    def move(self):
        if self.goal is not None:
            self.command, self.commanded_s = self.towards_goal(), self.now_s()
        silent = self.now_s() - self.commanded_s > 0.5
        self.speeds = (0.0, 0.0) if silent else self.command
        speed, turn = self.speeds
        self.pose[0] += speed * math.cos(self.pose[2]) * STEP_S
        self.pose[1] += speed * math.sin(self.pose[2]) * STEP_S
        self.pose[2] += turn * STEP_S
        self.moved_s = self.now_s()

    def pose_at(self, time_s):
        """Where the robot is between two steps."""
        (x, y, yaw), (speed, turn) = self.pose, self.speeds
        since_s = time_s - self.moved_s
        moved_m = speed * since_s
        return x + moved_m * math.cos(yaw), y + moved_m * math.sin(yaw), yaw + turn * since_s

    def in_odom(self, time_s):
        """The odometry's frame lies where the robot was at the start."""
        return motion_between(self.start, self.pose_at(time_s))

    def publish(self):
        now_s = self.now_s()
        odometry = Odometry(header=to_header("odom", now_s), child_frame_id="base_footprint")
        odometry.pose.pose = to_pose(self.in_odom(now_s))
        odometry.twist.twist = to_twist(Command(*self.speeds))
        self.odom.publish(odometry)
        x_m, y_m, yaw_rad = self.start
        x_m += 1.5 * (self.disturbance == "jump")
        parents = ["odom"] + ["visual_odom"] * (self.disturbance == "second parent")
        base = self.in_odom(now_s + 0.003)
        for each in (
            *((parent, "base_footprint", base, now_s + 0.003) for parent in parents),
            ("map", "odom", (x_m, y_m, yaw_rad), now_s + 0.9),
        ):
            self.tf.publish(MADE.transforms(each))
        self.publish_scan(now_s - 0.013)

    def ranges_m(self, time_s):
        ranges_m = [WALL_M] * N_RAYS
        if self.lidar is not None:
            people_m = walkers(time_s).position_m
            ranges_m = self.lidar.scan(compose(self.pose_at(time_s), MOUNT), *people_m.T)
        return [each + random.gauss(0.0, 0.01) for each in ranges_m]

    def publish_scan(self, time_s):
        message = LaserScan(
            header=to_header("laser", time_s), angle_min=-math.pi,
            angle_max=math.pi - math.tau / N_RAYS, angle_increment=math.tau / N_RAYS,
            range_min=0.1, range_max=12.0, ranges=array.array("f", self.ranges_m(time_s)),
        )  # fmt: skip
        self.scan.publish(message)


def walkers(time_s):
    """One who walks along the hallway and one who walks across, to and fro."""
    phase = math.tau * time_s / 12.0
    there_m, speed_mps = 1.5 * math.sin(phase), 1.5 * math.tau / 12.0 * math.cos(phase)
    place_m = np.array([[1.2, 3.5 + there_m], [3.0 + there_m, 6.0]])
    return People(place_m, np.array([[0.0, speed_mps], [speed_mps, 0.0]]), np.arange(2))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--start", type=float, nargs=2, default=(3.5, 1.5))
    parser.add_argument("--period", type=float, default=0.1)
    parser.add_argument("--follow", choices=("cmd_vel", "nav2"), default="cmd_vel")
    parser.add_argument("--people", action="store_true")
    options = parser.parse_args()
    rclpy.init()
    try:
        rclpy.spin(StandIn(options))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
