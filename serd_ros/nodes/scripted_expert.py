"""scripted_expert: demonstrates episodes by publishing one intent per decision epoch."""

from geometry_msgs.msg import Vector3Stamped

from serd_core.grid.grid import Action
from serd_ros.convert.command import to_intent
from serd_ros.endpoints import qos, topics
from serd_ros.episodes.driver import EpisodeDriverNode
from serd_ros.graph.configs import ScriptedExpertConfig
from serd_sim.drivers.catalogue import Driver, make_driver
from serd_sim.world.observation import Observation


class ScriptedExpertNode(EpisodeDriverNode[ScriptedExpertConfig]):
    """Steers by `intent`, as a person with arrow keys does."""

    def activate(self) -> None:
        """Publish intents."""
        super().activate()
        self._intents = self.create_publisher(Vector3Stamped, topics.INTENT, qos.STATE)

    def make_driver(self) -> Driver:
        """The expert that was asked for."""
        return make_driver(self.config.driver, self.scenario, self.config.seed)

    def steer(self, observation: Observation, action: Action) -> None:
        """Publish the intended direction."""
        self._intents.publish(to_intent(action, observation.time_s))
