"""What the strategy shows: policy, value, traps, the way it means to go, its predicted arrival."""

from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from serd_app.navigation.forecast_text import outlook_in_short
from serd_app.navigation.navigator import Outlook
from serd_app.navigation.strategy import Strategy, arrows_of
from serd_core.arrays import FloatArray
from serd_ros.convert.arrival import to_arrival_message
from serd_ros.convert.goal import to_goal_area_message
from serd_ros.convert.markers import (
    to_policy_markers,
    to_text_marker,
    to_trap_markers,
    to_value_markers,
)
from serd_ros.convert.path import to_path
from serd_ros.endpoints import qos, topics


class StrategyDisplay:
    """Publishes on behalf of a node; all but the way is latched, for viewers that come late."""

    def __init__(self, node: Node) -> None:
        self._goal = node.create_publisher(PolygonStamped, topics.GOAL_AREA, qos.LATCHED)
        self._arrival = node.create_publisher(Float64MultiArray, topics.ARRIVAL, qos.LATCHED)
        self._way = node.create_publisher(Path, topics.PLAN, qos.COMMAND)
        self._arrows = node.create_publisher(MarkerArray, topics.MARKERS_POLICY, qos.LATCHED)
        self._values = node.create_publisher(MarkerArray, topics.MARKERS_VALUE, qos.LATCHED)
        self._traps = node.create_publisher(MarkerArray, topics.MARKERS_TRAPS, qos.LATCHED)
        self._text = node.create_publisher(MarkerArray, topics.MARKERS_ARRIVAL, qos.LATCHED)

    def show_strategy(self, strategy: Strategy, time_s: float) -> None:
        """Show a new plan: its goal, arrows, values and traps."""
        grid, policy = strategy.problem.grid, strategy.policy
        centers_m, size_m = grid.centers_m, grid.cell_size_m
        self._goal.publish(to_goal_area_message(strategy.scenario.goal_area_m, time_s))
        self._arrows.publish(to_policy_markers(centers_m, arrows_of(policy), size_m, time_s))
        self._values.publish(to_value_markers(centers_m, policy.value, size_m, time_s))
        trapped_m = centers_m[strategy.traps.states]
        self._traps.publish(to_trap_markers(trapped_m, size_m, time_s))

    def show_outlook(self, outlook: Outlook, way_m: FloatArray) -> None:
        """Show what a decision was made on; way_m: (N, 2)."""
        time_s = outlook.time_s
        self._arrival.publish(to_arrival_message(outlook.law, time_s))
        if self._way.get_subscription_count():
            self._way.publish(to_path(way_m, time_s))
        if self._text.get_subscription_count() and len(way_m):
            words = outlook_in_short(outlook)
            self._text.publish(to_text_marker(words, (way_m[0, 0], way_m[0, 1]), time_s))
