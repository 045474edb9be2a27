"""The service by which a driver requests the next episode of a simulated world."""

import math
from collections.abc import Callable

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger

from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.endpoints import qos, topics
from serd_ros.errors import NodeError
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.graph.readiness import Readiness
from serd_ros.process.serd_node import SerdNode
from serd_sim.episodes.result import EpisodeStart
from serd_sim.world.world import HallwayWorld

#: The robot stands where it was placed up to this distance (m, rad): the physical drive settles.
_SETTLES = 0.01


class EpisodeRequests:
    """Serves `reset`. begin: begins the next episode of the world and returns its start.

    A response may be late or lost, and the driver then repeats its request. So `reset` responds
    with the same episode again until the driver marks it or the robot moves. Where no node
    publishes marks, each request begins the next episode.
    """

    def __init__(
        self,
        node: SerdNode[HallwaySimConfig],
        world: HallwayWorld,
        begin: Callable[[], EpisodeStart],
    ) -> None:
        self._node, self._world, self._begin = node, world, begin
        #: The last response, until the driver publishes a mark of it.
        self._begun: EpisodeStart | None = None
        self._start_pose = (0.0, 0.0, 0.0)
        self._readiness = Readiness(node, node.config.required_nodes, node.wall_s())
        node.serve(Trigger, topics.RESET, self._on_reset)
        node.create_subscription(DiagnosticArray, topics.EPISODE, self._on_mark, qos.LOSSLESS)

    @property
    def _is_new_request(self) -> bool:
        """Whether a request is no repetition of one that was answered."""
        x_m, y_m, yaw_rad = np.subtract(self._world.observation.pose, self._start_pose).tolist()
        moved = max(abs(x_m), abs(y_m), abs(math.remainder(yaw_rad, math.tau)))
        return moved > _SETTLES or self._node.count_publishers(topics.EPISODE) == 0

    def _on_reset(self, _: Trigger.Request) -> str:
        missing = self._readiness.missing(self._node.wall_s())
        if missing:
            raise NodeError(missing)
        if self._begun is None or self._is_new_request:
            self._begun = self._begin()
            self._start_pose = self._world.observation.pose
        return self._begun.model_dump_json()

    def _on_mark(self, message: DiagnosticArray) -> None:
        """A mark of the episode shows that its driver received the response."""
        if self._begun is not None and self._begun.episode == from_episode_message(message).episode:
            self._begun = None
