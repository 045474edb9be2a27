"""strategy: drives episodes by the learned policy with waypoints and measures times of arrival."""

import sys

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from visualization_msgs.msg import MarkerArray

from serd_core.grid import Action
from serd_ros import qos, topics
from serd_ros.configs import StrategyConfig
from serd_ros.convert.markers import to_policy_markers, to_value_markers
from serd_ros.convert.path import to_path
from serd_ros.convert.pose import to_waypoint_message
from serd_ros.episode_driver import EpisodeDriverNode
from serd_ros.run_node import run_node
from serd_ros.strategy import Strategy, arrows_of, load_strategy
from sim.decision import waypoint_of_intent
from sim.driver import Driver
from sim.observation import Observation
from sim.policy_driver import PolicyDriver


class StrategyNode(EpisodeDriverNode[StrategyConfig]):
    """Steers by `waypoint`: the centre of the cell the policy wants next."""

    _strategy: Strategy

    def __init__(self) -> None:
        super().__init__("strategy", StrategyConfig)
        self._waypoints = self.create_publisher(PoseStamped, topics.WAYPOINT, qos.STATE)
        self._plan = self.create_publisher(Path, topics.PLAN, qos.COMMAND)
        self._arrows = self.create_publisher(MarkerArray, topics.MARKERS_POLICY, qos.LATCHED)
        self._values = self.create_publisher(MarkerArray, topics.MARKERS_VALUE, qos.LATCHED)
        self._show_policy()

    def make_driver(self) -> Driver:
        """The policy of the model file; its file must belong to this scenario's grid."""
        config = self.config
        self._strategy = load_strategy(config.model, self.scenario, config.policy)
        return PolicyDriver(
            self._strategy.problem.grid,
            self._strategy.policy.probabilities,
            seed=config.seed,
            greedy=config.policy == "optimal",
            name="strategy",
        )

    def steer(self, observation: Observation, action: Action) -> None:
        """Publish the waypoint, and the way to the goal for viewers."""
        grid = self._strategy.problem.grid
        waypoint = waypoint_of_intent(grid, observation, action)
        self._waypoints.publish(to_waypoint_message(waypoint, observation.time_s))
        state = grid.state_at(observation.x_m, observation.y_m)
        if state >= 0 and self._plan.get_subscription_count():
            path_m = self._strategy.intended_path_m(state)
            self._plan.publish(to_path(path_m, observation.time_s))

    def _show_policy(self) -> None:
        grid, policy = self._strategy.problem.grid, self._strategy.policy
        arrows = to_policy_markers(grid.centers_m, arrows_of(policy), grid.cell_size_m, 0.0)
        self._arrows.publish(arrows)
        values = to_value_markers(grid.centers_m, policy.value, grid.cell_size_m, 0.0)
        self._values.publish(values)


def main() -> int:
    """Entry point of `ros2 run serd_ros strategy`."""
    return run_node(StrategyNode)


if __name__ == "__main__":
    sys.exit(main())
