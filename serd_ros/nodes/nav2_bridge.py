"""nav2_bridge: Nav2 drives instead of our local planner; for full ROS installations.

The strategy's `waypoint` becomes a goal of `navigate_to_pose`, or its `plan` one of
`navigate_through_poses`; /tf, which Nav2 needs, is made from `robot_pose` and `odom`. nav2_msgs
comes with ROS, not as a wheel, so this node imports it when it starts.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path

from serd_app.navigation.nav2_goals import Nav2Goals, Target
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.pose import PlanarPose, from_odometry, from_pose_stamped, to_pose_stamped
from serd_ros.convert.stamp import Jump, StampClock
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.transforms import TransformPublisher, follow_transforms
from serd_ros.errors import NodeError
from serd_ros.graph.configs import Nav2BridgeConfig
from serd_ros.process.managed_node import ManagedNode

_WATCH_S = 0.5
_LOG_PERIOD_S = 5.0


class Nav2BridgeNode(ManagedNode[Nav2BridgeConfig]):
    """`waypoint` or `plan` in, one Nav2 goal at a time out; silence stops Nav2."""

    def configure(self) -> None:
        """Look up the action."""
        through = self.config.mode == "through_poses"
        kind = ros_type("nav2_msgs.action", "NavigateThroughPoses" if through else "NavigateToPose")
        self._kind = kind
        self._action = "navigate_through_poses" if through else "navigate_to_pose"
        self._goals = Nav2Goals(
            self.action_client(kind, self._action),
            self._goal_message,
            timeout_s=self.config.waypoint_timeout_s,
        )

    def activate(self) -> None:
        """Send goals from now on."""
        if self.config.mode == "through_poses":
            self.create_subscription(Path, topics.PLAN, self._take, qos.COMMAND)
        self.create_subscription(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.COMMAND)
        self._odom_pose: PlanarPose | None = None
        self._stamp_clock = StampClock()
        if self.config.publish_tf:
            self._transforms = TransformPublisher(self)
            self.create_subscription(Odometry, topics.ODOM, self._on_odometry, qos.STATE)
            self.create_subscription(PoseStamped, topics.ROBOT_POSE, self._on_pose, qos.STATE)
        follow_transforms(self)
        self.create_timer(_WATCH_S, self._watch)

    def release(self) -> None:
        """Do not leave Nav2 driving."""
        self._goals.cancel()

    def _on_waypoint(self, message: PoseStamped) -> None:
        """A waypoint is repeated while the strategy drives, a plan is not."""
        if self.config.mode == "through_poses":
            self._goals.hear(self.wall_s())
        else:
            self._take(message)

    def _take(self, message: PoseStamped | Path) -> None:
        poses = message.poses if isinstance(message, Path) else [message]
        stamped = [from_pose_stamped(each, self.frames) for each in poses]
        if stamped:
            targets = [pose for _, pose in stamped]
            self._goals.take(targets, stamped[0][0] * 1e-9, self.wall_s())

    def _goal_message(self, targets: Sequence[Target], time_s: float) -> Any:
        poses = [to_pose_stamped(target, time_s) for target in targets]
        if self.config.mode == "through_poses":
            return self._kind.Goal(poses=poses, behavior_tree=self.config.behavior_tree)
        return self._kind.Goal(pose=poses[0], behavior_tree=self.config.behavior_tree)

    def _watch(self) -> None:
        if self._goals.expire(self.wall_s()):
            self.get_logger().warning("no waypoint in time: goal of Nav2 cancelled")
        well = self._goals.state in ("no goal", "sent", "driving", "arrived")
        if not well:
            self.get_logger().warning(
                f"{self._action}: {self._goals.state}", throttle_duration_sec=_LOG_PERIOD_S
            )
        time_s = self.get_clock().now().nanoseconds * 1e-9
        self.report(time_s, {"goal": self._goals.state}, level=OK if well else WARN)

    def _on_odometry(self, message: Odometry) -> None:
        _, self._odom_pose, _ = from_odometry(message, self.frames)

    def _on_pose(self, message: PoseStamped) -> None:
        time_ns, pose = from_pose_stamped(message, self.frames)
        if self._stamp_clock.advance(time_ns) in (Jump.FORWARD, Jump.BACKWARD):
            self._goals.cancel()  # until the next waypoint
            self._odom_pose = None
        if self._odom_pose is None:
            return
        self._transforms.publish(pose, self._odom_pose, time_ns * 1e-9)


def ros_type(module: str, name: str) -> Any:
    """A generated type of a full ROS installation; NodeError with the fix where it is missing."""
    try:
        return getattr(import_module(module), name)
    except ImportError:
        package = module.split(".", 1)[0]
        raise NodeError(
            f"nav2_bridge needs the ROS package {package}, which is not installed; run 'apt-get "
            f"install ros-jazzy-{package.replace('_', '-')}', or use the stack goto"
        ) from None
