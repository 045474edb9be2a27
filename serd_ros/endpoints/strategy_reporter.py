"""Output of the strategy: displays for viewers, `diagnostics` and the log."""

import array

import numpy as np
from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import Path
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout
from visualization_msgs.msg import MarkerArray

from serd_app.navigation.navigator import Navigator, plan_remarks
from serd_core.arrival.law import ArrivalLaw
from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.markers import (
    to_policy_markers,
    to_text_marker,
    to_trap_markers,
    to_value_markers,
)
from serd_ros.convert.pose import to_goal_area_message, to_path
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_sim.drivers.strategy import Strategy
from serd_sim.world.observation import Observation

_LOG_PERIOD_S = 5.0
_SMALLEST_STEP = 1e-3


class StrategyReporter:
    """Publishes for a node; all topics but `plan` are latched. time_s: of the last decision."""

    def __init__(self, endpoints: Endpoints) -> None:
        self.time_s = 0.0
        self._node = endpoints.node
        self._goal = endpoints.publisher(PolygonStamped, topics.GOAL_AREA, qos.LATCHED)
        self._arrival = endpoints.publisher(Float64MultiArray, topics.ARRIVAL, qos.LATCHED)
        self._way = endpoints.publisher(Path, topics.PLAN, qos.COMMAND)
        self._arrows = endpoints.publisher(MarkerArray, topics.MARKERS_POLICY, qos.LATCHED)
        self._values = endpoints.publisher(MarkerArray, topics.MARKERS_VALUE, qos.LATCHED)
        self._traps = endpoints.publisher(MarkerArray, topics.MARKERS_TRAPS, qos.LATCHED)
        self._text = endpoints.publisher(MarkerArray, topics.MARKERS_ARRIVAL, qos.LATCHED)

    def report_plan(self, strategy: Strategy, cause: str, began_s: float) -> None:
        """Publish a new plan and log its remarks; began_s: wall time when planning began."""
        grid, policy = strategy.problem.grid, strategy.policy
        centers_m, size_m, time_s = grid.centers_m, grid.cell_size_m, self.time_s
        self._goal.publish(to_goal_area_message(strategy.scenario.goal_area_m, time_s))
        arrows = [Action(int(each)) for each in policy.greedy]
        self._arrows.publish(to_policy_markers(centers_m, arrows, size_m, time_s))
        self._values.publish(to_value_markers(centers_m, policy.value, size_m, time_s))
        trapped_m = centers_m[strategy.traps.states]
        self._traps.publish(to_trap_markers(trapped_m, size_m, time_s))
        took_ms = 1e3 * (self._node.wall_s() - began_s)
        self._node.get_logger().info(f"{cause}: planned and published in {took_ms:.1f} ms")
        for remark in plan_remarks(strategy):
            self._node.get_logger().warning(remark)

    def report_decision(self, navigator: Navigator, observation: Observation) -> None:
        """Publish the forecast of the last decision; a drive that begins in its goal has none."""
        forecast = navigator.forecast
        if forecast is None:
            return
        self.time_s = forecast.time_s
        way_m = navigator.way_m(observation)
        self._arrival.publish(to_arrival_message(forecast.law, self.time_s))
        if self._way.get_subscription_count():
            self._way.publish(to_path(way_m, self.time_s))
        if self._text.get_subscription_count() and len(way_m):
            above_m = (way_m[0, 0], way_m[0, 1])
            self._text.publish(to_text_marker(forecast.summary, above_m, self.time_s))
        if forecast.needs_attention:
            self._node.get_logger().warning(
                f"{forecast.situation} at ({observation.x_m:.1f}, {observation.y_m:.1f}) m: "
                f"{forecast.summary}",
                throttle_duration_sec=_LOG_PERIOD_S,
            )
        values = {
            **forecast.values(),
            "n_trap_states": len(navigator.strategy.traps.states),
            "n_least_time_states": int(navigator.strategy.by_time.sum()),
            "transferred": navigator.strategy.transferred,
        }
        level = WARN if forecast.needs_attention else OK
        self._node.report(self.time_s, values, level=level, message=forecast.situation)

    def report_rejection(self, error: Exception) -> None:
        """Report a goal or a model that cannot be used."""
        self._node.get_logger().warning(f"refused, the plan stays: {error}")
        self._node.report(self.time_s, {}, level=WARN, message=f"refused: {error}")

    def report_give_up(self, reason: str) -> None:
        """Report the end of a drive that did not arrive."""
        self._node.report(self.time_s, {"reason": reason}, level=WARN, message="gave up")


def to_arrival_message(law: ArrivalLaw, now_s: float) -> Float64MultiArray:
    """The law of the remaining time as seen at `now_s`: a row of times, a row of probabilities.

    Row 0: times (s) on the clock of the observations, the first one being when the prediction was
    made; row 1: predicted probability of having arrived by then, given no arrival so far. Steps of
    less than a thousandth are left out. Nothing with a header and named columns is among the
    messages that tools plot.
    """
    kept = [0]
    for step in range(1, len(law.cdf)):
        if law.cdf[step] - law.cdf[kept[-1]] >= _SMALLEST_STEP:
            kept.append(step)
    size = len(kept)
    columns = MultiArrayDimension(label="time_s, probability", size=2, stride=2 * size)
    steps = MultiArrayDimension(label="step", size=size, stride=size)
    layout = MultiArrayLayout(dim=[columns, steps], data_offset=0)
    rows = np.concatenate([law.times_s[kept] + now_s, law.cdf[kept]])
    return Float64MultiArray(layout=layout, data=array.array("d", rows.tobytes()))
