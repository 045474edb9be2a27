"""One robot of a simulated world: what it observes, its commands, its goal, its episodes."""

import math
from collections.abc import Callable

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
from std_srvs.srv import Trigger

from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.convert.pose import from_goal_area_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.world.world_publisher import WorldPublisher
from serd_ros.errors import NodeError
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.graph.readiness import Readiness
from serd_ros.process.serd_node import SerdNode
from sim.episodes.result import EpisodeStart
from sim.world.world import HallwayWorld

#: A robot stands where it was placed up to this distance (m, rad): the physical drive settles.
_SETTLES = 0.01


class SimulatedRobot:
    """node: has its topics and services; world: as this robot observes it.

    asked: its driver has asked for the next episode. begun: an episode that began since, until
    its driver publishes a mark of it. on_ask: called with a request that waits for others; returns
    what it waits for.

    A response may be late or lost, and the driver then repeats its request. So `reset` responds
    with the same episode again until the driver marks it or the robot moves. Where no node
    publishes marks, each request after an answered one begins the next episode.
    """

    def __init__(
        self,
        node: SerdNode[HallwaySimConfig],
        world: HallwayWorld,
        *,
        on_ask: Callable[[], str],
        on_goal: Callable[[], None],
    ) -> None:
        self.node, self.world = node, world
        self.asked = self._has_ever_asked = False
        self.begun: EpisodeStart | None = None
        self._is_answered, self._start_pose = False, (0.0, 0.0, 0.0)
        self.publisher = WorldPublisher(node, world)
        self._readiness = Readiness(node, node.config.required_nodes, node.wall_s())
        self._on_ask, self._on_goal_moved = on_ask, on_goal
        node.serve(Trigger, topics.RESET, self._on_reset)
        node.create_subscription(PolygonStamped, topics.GOAL_AREA, self._on_goal, qos.LATCHED)
        node.create_subscription(DiagnosticArray, topics.EPISODE, self._on_mark, qos.LOSSLESS)

    @property
    def has_driver(self) -> bool:
        """Whether a node drives its episodes."""
        return self.node.count_publishers(topics.EPISODE) > 0

    @property
    def is_driven(self) -> bool:
        """Whether there is a driver that may take the next decision."""
        return self.has_driver and not self.asked

    @property
    def is_waited_for(self) -> bool:
        """Whether its driver must request an episode before one begins.

        Nodes of another robot may be up first, so a required driver is waited for until its
        first request.
        """
        is_starting = any(self.node.config.required_nodes) and not self._has_ever_asked
        return not self.asked and (is_starting or self.has_driver)

    @property
    def name(self) -> str:
        """Its namespace."""
        return str(self.node.get_namespace())

    @property
    def command_topic(self) -> str:
        """Where its commands come from, in full."""
        return str(self.node.resolve_topic_name(topics.CMD_VEL))

    def begin(self, episode: EpisodeStart) -> None:
        """An episode has begun."""
        self.begun = episode if self.asked else None
        self.asked = self._is_answered = False
        self._start_pose = self.world.observation.pose

    @property
    def _is_new_request(self) -> bool:
        """Whether a request is no repetition of one that was answered."""
        x_m, y_m, yaw_rad = np.subtract(self.world.observation.pose, self._start_pose).tolist()
        moved = max(abs(x_m), abs(y_m), abs(math.remainder(yaw_rad, math.tau)))
        return self._is_answered and (moved > _SETTLES or not self.has_driver)

    def _on_reset(self, _: Trigger.Request) -> str:
        missing = self._readiness.missing(self.node.wall_s())
        if not missing and (self.begun is None or self._is_new_request):
            self.asked, self.begun, self._has_ever_asked = True, None, True
            missing = self._on_ask()
        if missing:
            raise NodeError(missing)
        if self.begun is None:
            return ""
        self._is_answered = True
        return self.begun.model_dump_json()

    def _on_mark(self, message: DiagnosticArray) -> None:
        """A mark of the episode shows that its driver received the response."""
        if self.begun is not None and self.begun.episode == from_episode_message(message).episode:
            self.begun = None

    def _on_goal(self, message: PolygonStamped) -> None:
        """Set the goal of the driver: where its episode ends and it is no longer waited for."""
        goal_area_m = from_goal_area_message(message, self.world.scenario.goal_area_m)
        self.world.goal_area_m = goal_area_m
        self._on_goal_moved()
