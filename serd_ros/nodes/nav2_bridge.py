"""nav2_bridge: Nav2 drives instead of our local planner; for full ROS installations.

The strategy's `waypoint` becomes a goal of `navigate_to_pose`, or its `plan` one of
`navigate_through_poses`. nav2_msgs comes with ROS, not as a wheel, so this node imports it when it
starts.
"""

from collections.abc import Sequence
from functools import partial
from importlib import import_module
from typing import Any, Literal

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.action import ActionClient

from serd_app.navigation.nav2_goals import Nav2Goals, Target
from serd_files.settings import setting
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.motion import from_pose_stamped, to_pose_stamped
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import follow_transforms
from serd_ros.errors import NodeError
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import FramesConfig, ManagedConfig

_WATCH_S = 0.5
_LOG_PERIOD_S = 5.0


class Nav2BridgeConfig(FramesConfig, ManagedConfig):
    """Parameters of nav2_bridge."""

    mode: Literal["to_pose", "through_poses"] = setting(
        "to_pose", "to_pose: send each waypoint; through_poses: send the plan of the strategy"
    )
    waypoint_timeout_s: float = setting(1.0, "cancel without waypoints", unit="s", gt=0)


class Nav2BridgeNode(SerdNode[Nav2BridgeConfig]):
    """Sends goals to Nav2 while it is active."""

    config_class = Nav2BridgeConfig

    def __init__(self, kind: str) -> None:
        self._action_clients: dict[str, ActionClient] = {}
        super().__init__(kind)

    def configure(self) -> Activate:
        """Look up the action."""
        through = self.config.mode == "through_poses"
        kind = ros_type("nav2_msgs.action", "NavigateThroughPoses" if through else "NavigateToPose")
        name = "navigate_through_poses" if through else "navigate_to_pose"
        return partial(Nav2Bridge, name, kind.Goal, self._action_client(kind, name))

    def _action_client(self, kind: Any, name: str) -> ActionClient:
        """The client of an action, made once and kept while the process lives.

        The events executor drops what it keeps of an action client without Python's lock: where
        one is destroyed while a message waits for it, the process ends by a segmentation fault.
        """
        if name not in self._action_clients:
            self._action_clients[name] = ActionClient(self, kind, name)
        return self._action_clients[name]


class Nav2Bridge(Activity):
    """`waypoint` or `plan` in, one Nav2 goal at a time out; silence stops Nav2."""

    def __init__(self, action: str, goal: Any, client: ActionClient, endpoints: Endpoints) -> None:
        self._node, self._action, self._goal = endpoints.node, action, goal
        config = self._config = endpoints.node.config
        self._goals = Nav2Goals(client, self._goal_message, timeout_s=config.waypoint_timeout_s)
        if config.mode == "through_poses":
            endpoints.subscribe(Path, topics.PLAN, self._take, qos.COMMAND)
        endpoints.subscribe(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.COMMAND)
        follow_transforms(endpoints)
        endpoints.every(_WATCH_S, self._watch)

    def close(self) -> None:
        """Do not leave Nav2 driving."""
        self._goals.cancel()

    def _on_waypoint(self, message: PoseStamped) -> None:
        """A waypoint is repeated while the strategy drives, a plan is not."""
        if self._config.mode == "through_poses":
            self._goals.hear(self._node.wall_s())
        else:
            self._take(message)

    def _take(self, message: PoseStamped | Path) -> None:
        poses = message.poses if isinstance(message, Path) else [message]
        stamped = [from_pose_stamped(each, self._node.frames) for each in poses]
        if stamped:
            targets = [pose for _, pose in stamped]
            self._goals.take(targets, stamped[0][0] * 1e-9, self._node.wall_s())

    def _goal_message(self, targets: Sequence[Target], time_s: float) -> Any:
        poses = [to_pose_stamped(target, time_s) for target in targets]
        if self._config.mode == "through_poses":
            return self._goal(poses=poses)
        return self._goal(pose=poses[0])

    def _watch(self) -> None:
        if self._goals.expire(self._node.wall_s()):
            self._node.get_logger().warning("no waypoint in time: goal of Nav2 cancelled")
        well = self._goals.state in ("no goal", "sent", "driving", "arrived")
        if not well:
            self._node.get_logger().warning(
                f"{self._action}: {self._goals.state}", throttle_duration_sec=_LOG_PERIOD_S
            )
        time_s = self._node.now_s()
        self._node.report(time_s, {"goal": self._goals.state}, level=OK if well else WARN)


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
