"""Waypoints as goals of Nav2's action servers: one goal at a time, a new one replaces the old.

No node and no generated type in here: an action client and a function that makes goals come in, so
that tests run it against a stand-in.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

SUCCEEDED, CANCELED = 4, 5  # action_msgs/GoalStatus
_WITHOUT_CODE = "failed without a code (another client's goal may have replaced it)"
_SAME_M = 0.05
#: How long the server's answer to a goal is awaited, s.
_ANSWERED_WITHIN_S = 5.0

#: x and y in m, heading in rad.
Target = tuple[float, float, float]


class Nav2Goals:
    """Keeps Nav2 on its way to the newest targets.

    client: an rclpy.action.ActionClient, of which `server_is_ready` and `send_goal_async` are used.
    state: no goal, no server, sent, no answer, driving, arrived, rejected, canceled by another
    client, or failed with Nav2's error code or without one. timeout_s: without a waypoint.
    """

    def __init__(
        self, client: Any, make_goal: Callable[[Sequence[Target], float], Any], *, timeout_s: float
    ) -> None:
        self.state = "no goal"
        self._client, self._make_goal, self._timeout_s = client, make_goal, timeout_s
        self._targets: tuple[Target, ...] = ()
        self._waiting: tuple[tuple[Target, ...], float] | None = None
        #: What the server has not answered, and when it was sent.
        self._request: Any = None
        self._sent_wall_s = -math.inf
        self._handle: Any = None
        self._waypoint_wall_s = -math.inf

    def hear(self, wall_s: float) -> None:
        """Note that the source of the targets goes on."""
        self._waypoint_wall_s = wall_s

    def take(self, targets: Sequence[Target], time_s: float, wall_s: float) -> None:
        """Drive to the targets in turn (in the map); what Nav2 does already is not sent again."""
        self._waypoint_wall_s = wall_s
        self._forget_unanswered(wall_s)
        wanted = tuple(targets)
        if not wanted:
            return
        self._waiting = None  # only the newest wish counts
        if not self._client.server_is_ready():
            self._lose_server()
            return
        if _continues(wanted, self._targets):
            return
        if self._request is not None:
            self._waiting = wanted, time_s
            return
        self._send(wanted, time_s)

    def expire(self, wall_s: float) -> bool:
        """Stop Nav2 when no waypoint has come for too long; whether that was so."""
        self._forget_unanswered(wall_s)
        if self._targets and not self._client.server_is_ready():
            self._lose_server()
        is_idle = not self._targets and self._handle is None
        if is_idle or wall_s - self._waypoint_wall_s <= self._timeout_s:
            return False
        self.cancel()
        return True

    def cancel(self) -> None:
        """Let Nav2 stop where it is."""
        self._targets, self._waiting, self.state = (), None, "no goal"
        if self._handle is not None:
            self._handle.cancel_goal_async()
            self._handle = None

    def _lose_server(self) -> None:
        """Forget the targets that a server was sent which has gone."""
        self._targets, self._handle, self.state = (), None, "no server"

    def _send(self, targets: tuple[Target, ...], time_s: float) -> None:
        self._targets, self.state = targets, "sent"
        self._sent_wall_s = self._waypoint_wall_s
        self._request = self._client.send_goal_async(self._make_goal(targets, time_s))
        self._request.add_done_callback(self._on_answer)

    def _forget_unanswered(self, wall_s: float) -> None:
        if self._request is not None and wall_s - self._sent_wall_s > _ANSWERED_WITHIN_S:
            self._request, self._targets, self.state = None, (), "no answer"

    def _on_answer(self, request: Any) -> None:
        handle = request.result()
        if request is not self._request:  # forgotten
            if handle.accepted:
                handle.cancel_goal_async()
            return
        self._request = None
        if not handle.accepted:
            self._targets, self.state = (), "rejected"
        elif not self._targets:
            handle.cancel_goal_async()  # called off before the server had answered
        else:
            self._handle, self.state = handle, "driving"
            handle.get_result_async().add_done_callback(lambda done: self._on_end(handle, done))
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._send(*waiting)

    def _on_end(self, handle: Any, future: Any) -> None:
        """Note how a goal ended; the end of one that is being replaced, or was, is ignored."""
        if handle is not self._handle or self._request is not None:
            return
        self._handle = None
        answer = future.result()
        if answer.status == SUCCEEDED:
            self.state = "arrived"
            return
        # Forgotten, so that the next waypoint tries again.
        code = getattr(answer.result, "error_code", 0)
        reason = f"failed with code {code}" if code else _WITHOUT_CODE
        is_canceled = answer.status == CANCELED
        self._targets, self.state = (), "canceled by another client" if is_canceled else reason


def _continues(wanted: tuple[Target, ...], sent: tuple[Target, ...]) -> bool:
    """Whether the targets are those sent, or the rest of them."""
    rest = sent[-len(wanted) :]
    return len(rest) == len(wanted) and all(
        math.dist(new[:2], old[:2]) < _SAME_M for new, old in zip(wanted, rest, strict=True)
    )
