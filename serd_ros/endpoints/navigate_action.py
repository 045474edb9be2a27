"""The action server `navigate_to_pose` of a node that drives, as Nav2's clients know it.

RViz's goal tool and nav2_simple_commander send goals to it. A goal that cannot be driven to is
rejected; one whose plan or drive fails later is aborted with the error code of Nav2 that is nearest
to the reason. The reason is logged, published on `diagnostics`, and in the result of what is
aborted where its type has `error_msg` (Nav2 after Jazzy). nav2_msgs comes with ROS, not as a wheel:
without it there is no server.
"""

import math
from collections.abc import Callable
from importlib import import_module
from typing import Any, Literal

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future

from serd_files.errors import USER_ERRORS
from serd_ros.convert.diagnostics import WARN
from serd_ros.errors import NodeError
from serd_ros.process.callback_guard import CallbackGuard

#: Error codes of Nav2's planner, behaviour tree and controller.
TF_ERROR, GOAL_OUTSIDE_MAP, NO_VALID_PATH, PATIENCE_EXCEEDED = 203, 205, 208, 104
Ending = Literal["succeed", "abort", "canceled"]
_LARGEST_S = 2.0**31 - 1


class ActionGoal:
    """A goal of a client, until `end`."""

    def __init__(self, kind: Any, handle: Any, wall_s: float) -> None:
        self._kind, self._handle, self._began_wall_s = kind, handle, wall_s
        self._ending = Future()

    @property
    def pose(self) -> PoseStamped:
        """As the client sent it."""
        pose: PoseStamped = self._handle.request.pose
        return pose

    @property
    def is_cancelled(self) -> bool:
        """Whether the client wants it to end."""
        return bool(self._handle.is_cancel_requested)

    def end(self, how: Ending, reason: str = "", code: int = 0) -> None:
        """End it; code: why, as Nav2's error codes."""
        if not self._ending.done():
            self._ending.set_result((how, reason, code))

    def feed_back(
        self, pose: PoseStamped, wall_s: float, *, remaining_s: float, distance_m: float
    ) -> None:
        """Publish feedback. remaining_s: NaN where it is not known."""
        feedback = self._kind.Feedback()
        feedback.current_pose = pose
        feedback.navigation_time = _duration(wall_s - self._began_wall_s)
        feedback.estimated_time_remaining = _duration(remaining_s)
        feedback.distance_remaining = float(distance_m)
        self._handle.publish_feedback(feedback)

    async def result(self) -> Any:
        """Wait for the end, tell the client and return the result."""
        how, reason, code = await self._ending
        if how == "canceled" and not self.is_cancelled:
            how = "abort"
        getattr(self._handle, how)()
        result = self._kind.Result()
        result.error_code = code
        if hasattr(result, "error_msg"):
            result.error_msg = reason
        return result


def _duration(seconds: float) -> Duration:
    """A duration of at least 0; 0 for a time that is not known."""
    known_s = min(max(seconds, 0.0), _LARGEST_S) if math.isfinite(seconds) else 0.0
    return Duration(sec=int(known_s), nanosec=int(known_s % 1.0 * 1e9))


class NavigateToPoseServer:
    """The server of a node; like the node's action clients it lives as long as the process.

    taken: called with each goal; None while the node is not active, which rejects goals. check:
    called with the pose of each goal before, raises a SerdError where it is rejected.
    """

    def __init__(self, node: Node, name: str, guard: CallbackGuard) -> None:
        self.taken: Callable[[ActionGoal], None] | None = None
        self.check: Callable[[PoseStamped], None] = lambda _: None
        self._node, self._name = node, name
        self._kind = import_module("nav2_msgs.action").NavigateToPose
        self._goals: dict[bytes, ActionGoal] = {}
        self._server = ActionServer(
            node, self._kind, name, self._execute,
            goal_callback=self._may_begin,
            handle_accepted_callback=guard.of_messages(name, self._accept),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def _may_begin(self, request: Any) -> GoalResponse:
        try:
            if self.taken is None:
                raise NodeError("the node is not active; activate it")
            self.check(request.pose)
        except USER_ERRORS as error:
            reason = f"goal rejected: {error}"
            self._node.get_logger().warning(f"{self._name}: {reason}")
            self._node.report(self._node.now_s(), {}, level=WARN, message=reason)
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _accept(self, handle: Any) -> None:
        goal = ActionGoal(self._kind, handle, self._node.wall_s())
        self._goals[bytes(handle.goal_id.uuid)] = goal
        handle.execute()
        if self.taken is not None:
            self.taken(goal)
        else:  # it was deactivated since
            goal.end("abort", "the node is not active")

    async def _execute(self, handle: Any) -> Any:
        return await self._goals.pop(bytes(handle.goal_id.uuid)).result()


def navigate_to_pose_server(
    node: Node, name: str, guard: CallbackGuard
) -> NavigateToPoseServer | None:
    """The server of that name, None for an empty name or without nav2_msgs."""
    if not name:
        return None
    try:
        return NavigateToPoseServer(node, name, guard)
    except ImportError:
        node.get_logger().info(f"nav2_msgs is not installed: there is no action {name}")
        return None
