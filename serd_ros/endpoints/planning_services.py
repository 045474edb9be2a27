"""Services for task planners: `get_plan`, with predicted times, and `forecast_arrival`.

A plan is answered at once. The law of arrival of another goal takes seconds on a large map, so it
is computed in a thread; an answer that is not there in time asks the client to come again. The
type of `forecast_arrival` is of serd_msgs, without which it is not served.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.serialization import deserialize_message

from serd_app.navigation.navigator import Navigator
from serd_app.navigation.newest_job import NewestJob
from serd_core.arrays import FloatArray
from serd_ros.convert import motion
from serd_ros.convert.stamp import to_stamp
from serd_ros.convert.typed import SHARES, to_arrival_forecast
from serd_ros.endpoints import topics
from serd_ros.errors import NodeError
from serd_ros.process.serd_node import Endpoints
from serd_sim.drivers.strategy import Strategy
from serd_sim.scenario.grid import goal_at, goal_cell
from serd_sim.world.observation import Observation

_ANSWERED_WITHIN_S = 0.3
_LOOK_S = 0.005
_MOST_KEPT = 16


class PlanningServices:
    """Answers about plans by the model in use, to any goal and from any place.

    here: the newest observation of the robot, None before the first.
    """

    def __init__(
        self, endpoints: Endpoints, navigator: Navigator, here: Callable[[], Observation | None]
    ) -> None:
        self._node, self._navigator, self._here = endpoints.node, navigator, here
        #: By goal area and identity of the model, the newest last.
        self._kept: dict[Any, Strategy] = {}
        self._laws = NewestJob()
        self._asked: Strategy | None = None
        endpoints.answer(GetPlan, topics.GET_PLAN, self._on_get_plan)
        try:
            kind = import_module("serd_msgs.srv").ForecastArrival
        except ImportError:
            self._node.get_logger().info("serd_msgs is not installed: no forecast_arrival")
        else:
            endpoints.answer(kind, topics.FORECAST_ARRIVAL, self._on_forecast)

    def _on_get_plan(self, request: Any, response: Any) -> None:
        strategy = self._strategy_for(request.goal)
        state, time_s = self._start(strategy, request.start)
        response.plan = timed_path(strategy, state, time_s)
        if request.goal.header.frame_id and response.plan.poses:
            goal = motion.from_goal_pose(request.goal, self._node.frames)
            response.plan.poses[-1].pose = motion.to_goal(goal, response.plan.poses[-1].pose)

    def _on_forecast(self, request: Any, response: Any) -> None:
        strategy = self._strategy_for(request.goal)
        state, time_s = self._start(strategy, request.start)
        self._require_law(strategy)
        data = to_arrival_forecast(
            strategy.law_of_cell(state), time_s,
            elapsed_s=0.0,
            area_m=strategy.scenario.goal_area_m,
            deadline_s=_deadline_s(request.deadline, strategy),
            shares=_shares(request.shares) or SHARES,
        )  # fmt: skip
        response.forecast = deserialize_message(data, type(response.forecast))
        response.success = True

    def _strategy_for(self, goal: PoseStamped) -> Strategy:
        present = self._navigator.strategy
        if not goal.header.frame_id:
            return present
        pose = motion.from_goal_pose(goal, self._node.frames)
        scenario = goal_at(present.scenario, pose.x_m, pose.y_m)
        key = scenario.goal_area_m, id(present.file)
        if key not in self._kept:
            wanted = replace(self._navigator.wanted, scenario=scenario, file=present.file)
            self._kept[key] = self._navigator.solve(wanted)
            while len(self._kept) > _MOST_KEPT:
                del self._kept[next(iter(self._kept))]
        return self._kept[key]

    def _start(self, strategy: Strategy, start: PoseStamped) -> tuple[int, float]:
        """(cell, time in s) of a start; NodeError where the robot's place is not known."""
        if start.header.frame_id:
            pose = motion.from_goal_pose(start, self._node.frames)
            x_m, y_m, time_s = pose.x_m, pose.y_m, self._node.now_s()
        elif (seen := self._here()) is not None:
            x_m, y_m, time_s = seen.x_m, seen.y_m, seen.time_s
        else:
            raise NodeError("start must be given, as no pose of the robot is known; set start")
        return goal_cell(strategy.problem.grid, x_m, y_m, what="start"), time_s

    def _require_law(self, strategy: Strategy) -> None:
        """NodeError while the law is being computed."""
        if strategy is not self._asked and not strategy.has_law:
            self._asked = strategy
            self._laws.begin(lambda: strategy.arrival)
        until_s = time.monotonic() + _ANSWERED_WITHIN_S
        while not strategy.has_law and time.monotonic() < until_s:
            time.sleep(_LOOK_S)
        if isinstance(failed := self._laws.poll(), Exception):
            self._asked = None
            raise failed
        if not strategy.has_law:
            raise NodeError("the forecast is being computed, which takes seconds; ask again")


def _deadline_s(deadline_s: float, strategy: Strategy) -> float:
    if not (math.isfinite(deadline_s) and deadline_s >= 0.0):
        raise NodeError(
            f"deadline must be finite and at least 0, got {deadline_s}; 0: the time-out"
        )
    return deadline_s or strategy.timeout_s


def _shares(shares: Any) -> tuple[float, ...]:
    found = tuple(map(float, shares))
    if not all(0.0 < share <= 1.0 for share in found) or list(found) != sorted(found):
        raise NodeError(f"shares must be above 0 and at most 1, ascending, got {found}")
    return found


def timed_path(strategy: Strategy, state: int, time_s: float) -> Path:
    """The way of the greedy policy from a cell at a time, each pose with its predicted time.

    That is the time at a cell: the mean remaining time of the start less that of the cell.
    """
    path = motion.to_path(strategy.intended_path_m(state), time_s)
    for pose, at_s in zip(path.poses, time_s + _after_s(strategy, state), strict=True):
        pose.header.stamp = to_stamp(float(at_s))
    return path


def _after_s(strategy: Strategy, state: int) -> FloatArray:
    mean_s = strategy.mean_s[strategy.intended_path(state)]
    return np.asarray(np.maximum.accumulate(mean_s[0] - mean_s))
