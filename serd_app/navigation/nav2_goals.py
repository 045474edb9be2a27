"""Waypoints as goals of Nav2's action servers: one goal at a time, a new one replaces the old.

There is one notion of arrival, that of the strategy: the robot is in the cell. Nav2 ends a goal
within its `xy_goal_tolerance` of it, which may be in the cell before. Then the goal is sent again,
further ahead by a quarter of the tolerance each time, so that Nav2 ends at the waypoint itself at
the latest. Cells of at least `CELL_TOLERANCES` tolerances need none of that: from the middle of a
cell to where the robot has left the one before (`serd_sim.world.epochs`) they have 0.4 cells.

No node and no generated type in here: an action client and a function that makes goals come in, so
that tests run it against a stand-in.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

SUCCEEDED, CANCELED = 4, 5  # action_msgs/GoalStatus
_WITHOUT_CODE = "failed without a code (another client's goal may have replaced it)"
_SAME_M = 0.05
CELL_TOLERANCES = 2.5
#: After the end of a goal the strategy has this time (s) to see that the robot is in the cell.
_SEEN_WITHIN_S = 0.5
_MOST_STEPS = 4
#: How long the server's answer to a goal is awaited, s.
_ANSWERED_WITHIN_S = 5.0

#: x and y in m, heading in rad.
Target = tuple[float, float, float]


class Nav2Goals:
    """Keeps Nav2 on its way to the newest targets.

    client: an rclpy.action.ActionClient, of which `server_is_ready` and `send_goal_async` are used.
    state: no goal, no server, sent, no answer, driving, arrived, rejected, canceled by another
    client, or failed with Nav2's error code or without one. timeout_s: without a waypoint.
    tolerance_m: Nav2's, which may change; robot: its newest place in the map, None if unknown.
    """

    def __init__(
        self,
        client: Any,
        make_goal: Callable[[Sequence[Target], float], Any],
        *,
        timeout_s: float,
        tolerance_m: float = 0.25,
    ) -> None:
        self.state, self.tolerance_m = "no goal", tolerance_m
        self.robot: Target | None = None
        self._client, self._make_goal, self._timeout_s = client, make_goal, timeout_s
        self._targets: tuple[Target, ...] = ()
        #: How many quarters of the tolerance the goal lies beyond the last target.
        self._n_beyond = 0
        self._ended_wall_s = -math.inf
        self._waiting: tuple[tuple[Target, ...], float] | None = None
        #: What the server has not answered, and when it was sent.
        self._request: Any = None
        self._sent_wall_s = -math.inf
        self._handle: Any = None
        self._waypoint_wall_s = -math.inf

    @property
    def ready(self) -> bool:
        """Whether the action server is there."""
        return bool(self._client.server_is_ready())

    def take(self, targets: Sequence[Target], time_s: float, wall_s: float) -> None:
        """Drive to the targets in turn (in the map); what Nav2 does already is not sent again.

        Where Nav2 ended short of the last one it is.
        """
        self._waypoint_wall_s = wall_s
        self._forget_unanswered(wall_s)
        wanted = tuple(targets)
        if not wanted:
            return
        self._waiting = None  # only the newest wish counts
        if not self.ready:
            self._lose_server()
            return
        if _continues(wanted, self._targets):
            self._targets = wanted
            if self._is_short(wall_s):
                self._n_beyond = min(self._n_beyond + 1, _MOST_STEPS)
                self._send(wanted, time_s)
            return
        self._n_beyond = 0
        if self._request is not None:
            self._waiting = wanted, time_s
            return
        self._send(wanted, time_s)

    def expire(self, wall_s: float) -> bool:
        """Stop Nav2 when no waypoint has come for too long; whether that was so."""
        self._forget_unanswered(wall_s)
        if self._targets and not self.ready:
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

    def _is_short(self, wall_s: float) -> bool:
        """Whether Nav2 has ended, and the robot was not seen where it was to drive since."""
        settled = self.state == "arrived" and wall_s - self._ended_wall_s > _SEEN_WITHIN_S
        if not (settled and self._targets) or self.robot is None:
            return False
        return math.dist(self.robot[:2], self._targets[-1][:2]) > _SAME_M

    def _beyond(self, targets: tuple[Target, ...]) -> tuple[Target, ...]:
        """The targets, the last one further ahead as seen from the robot."""
        if not self._n_beyond or self.robot is None:
            return targets
        (x_m, y_m, yaw_rad), (from_x_m, from_y_m, _) = targets[-1], self.robot
        away_m = math.hypot(x_m - from_x_m, y_m - from_y_m)
        share = self._n_beyond / _MOST_STEPS * self.tolerance_m / max(away_m, _SAME_M)
        moved = x_m + share * (x_m - from_x_m), y_m + share * (y_m - from_y_m), yaw_rad
        return (*targets[:-1], moved)

    def _lose_server(self) -> None:
        """Forget the targets that a server was sent which has gone."""
        self._targets, self._handle, self.state = (), None, "no server"

    def _send(self, targets: tuple[Target, ...], time_s: float) -> None:
        self._targets, self.state = targets, "sent"
        self._sent_wall_s = self._waypoint_wall_s
        goal = self._make_goal(self._beyond(targets), time_s)
        self._request = self._client.send_goal_async(goal)
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
        self._handle, self._ended_wall_s = None, self._waypoint_wall_s
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
