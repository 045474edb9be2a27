r"""A local planner of your own, as a ROS node: it drives straight to the goal that you send.

    serd run serd_ros hallway_sim --ros-args -p scenario:=corridor -p lockstep:=false
    serd run serd_ros guard --ros-args -p scenario:=corridor -p lockstep:=false \
        -p use_sim_time:=true
    python own_planner_node.py

These are the nodes of `serd launch live` without `local_planner`: the guard stops a robot that two
planners command. This one takes `goal_pose` (the 2D goal of RViz) and publishes `cmd_vel_raw`.
"""

import math

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

FASTEST_MPS, FASTEST_RADPS, THERE_M = 0.6, 1.5, 0.3


class StraightPlanner(Node):
    """Answers each pose of the robot by one command."""

    def __init__(self) -> None:
        super().__init__("straight_planner")
        self.goal: PoseStamped | None = None
        self.commands = self.create_publisher(Twist, "cmd_vel_raw", 10)
        self.create_subscription(PoseStamped, "goal_pose", self.take_goal, 10)
        self.create_subscription(PoseStamped, "robot_pose", self.step, 10)

    def take_goal(self, goal: PoseStamped) -> None:
        """Drive to this goal from the next pose on."""
        self.goal = goal

    def step(self, robot: PoseStamped) -> None:
        """Publish the command for one pose: turn to the goal, and drive the more it is ahead."""
        if self.goal is None:
            return
        to_go, turned = self.goal.pose.position, robot.pose.orientation
        east_m, north_m = to_go.x - robot.pose.position.x, to_go.y - robot.pose.position.y
        command = Twist()
        if math.hypot(east_m, north_m) > THERE_M:
            yaw_rad = 2.0 * math.atan2(turned.z, turned.w)
            turn_rad = math.remainder(math.atan2(north_m, east_m) - yaw_rad, math.tau)
            command.linear.x = FASTEST_MPS * max(0.0, math.cos(turn_rad))
            command.angular.z = max(-FASTEST_RADPS, min(2.0 * turn_rad, FASTEST_RADPS))
        self.commands.publish(command)


if __name__ == "__main__":
    rclpy.init()
    try:
        rclpy.spin(StraightPlanner())
    except (KeyboardInterrupt, ExternalShutdownException):
        print("ended")
