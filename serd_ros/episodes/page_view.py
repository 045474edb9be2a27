"""The state that the page shows: world, intent, waypoint, episode, mux, recorder and learner."""

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Vector3Stamped
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan

from serd_core.grid.grid import Action, Grid
from serd_ros.convert.command import from_intent
from serd_ros.convert.diagnostics import from_learner_report, values_of
from serd_ros.convert.pose import from_waypoint_message
from serd_ros.convert.sensors import from_scan
from serd_ros.endpoints import qos, topics
from serd_ros.episodes.person_episodes import PersonEpisodes
from serd_ros.process.serd_node import SerdNode
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint, waypoint_of_intent
from teleop.page.view import point, word, world_state

_SHOWN = ("teleop_mux", "guard", "demo_recorder")
_STALE_S = 1.0


class PageView:
    """Subscribes to what the front end itself does not need, and composes the state."""

    def __init__(self, node: SerdNode[Any], scenario: Scenario) -> None:
        self.grid: Grid = grid_of(scenario)
        self._node, self._scenario = node, scenario
        self._observation: Observation | None = None
        self._seen_wall_s = node.wall_s()
        self._ranges: NDArray[np.float32] | None = None
        self._action = Action.WAIT
        self._waypoint: Waypoint | None = None
        self._health: dict[str, dict[str, str]] = {}
        self._next_start: tuple[float, float] | None = None
        node.create_subscription(LaserScan, topics.SCAN, self._on_scan, qos.STATE)
        node.create_subscription(Vector3Stamped, topics.INTENT, self._on_intent, qos.STATE)
        node.create_subscription(PoseStamped, topics.WAYPOINT, self._on_waypoint, qos.STATE)
        node.create_subscription(
            DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, qos.STATE
        )

    def state(self, observation: Observation | None, episodes: PersonEpisodes) -> dict[str, Any]:
        """Everything the page needs to draw itself."""
        now_s = self._node.wall_s()
        if observation is not self._observation:
            self._observation, self._seen_wall_s = observation, now_s
        ranges, self._ranges = self._ranges, None
        world = None if observation is None else world_state(observation, self._scenario, ranges)
        return {
            "type": "state",
            "world": world,
            "is_stale": observation is None or now_s - self._seen_wall_s > _STALE_S,
            "action": word(self._action),
            "waypoint": point(self._waypoint),
            "episode": _episode_values(episodes),
            "mux": self._health.get("teleop_mux"),
            "guard": self._health.get("guard"),
            "recorder": self._health.get("demo_recorder"),
            "next_start": self._next_start,
        }

    def clear(self) -> None:
        """Discard what was received before a jump of the clock."""
        self._ranges, self._waypoint, self._action = None, None, Action.WAIT

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for name in _SHOWN:
            values = values_of(message, name)
            if values is not None:
                self._health[name] = values
        if "converged" in (values_of(message, "learner") or {}):  # a fit has ended
            self._next_start = from_learner_report(message)

    def _on_scan(self, message: LaserScan) -> None:
        _, self._ranges = from_scan(message, self._scenario.lidar)

    def _on_intent(self, message: Vector3Stamped) -> None:
        _, self._action = from_intent(message)
        if self._observation is not None:
            waits = self._action == Action.WAIT
            target = waypoint_of_intent(self.grid, self._observation, self._action)
            self._waypoint = None if waits else target

    def _on_waypoint(self, message: PoseStamped) -> None:
        _, self._waypoint = from_waypoint_message(message)


def _episode_values(episodes: PersonEpisodes) -> dict[str, Any]:
    session, tally = episodes.session, episodes.tally
    return {
        "phase": session.phase,
        "number": episodes.number,
        "outcome": session.outcome,
        "duration_s": round(session.duration_s, 1),
        "decisions": episodes.n_decisions,
        "other_driver": episodes.other_driver,
        "kept": tally.kept,
        "arrived": tally.arrived,
        "discarded": tally.discarded,
    }
