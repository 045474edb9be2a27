"""scripted_expert: demonstrates episodes by publishing one intent per decision epoch."""

from functools import partial

from geometry_msgs.msg import Vector3Stamped

from serd_core.grid.grid import Action
from serd_files.settings import setting
from serd_files.table import EpisodeResult
from serd_ros.convert.motion import to_intent
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.episode_runner import EpisodeRunner
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import DriverConfig
from serd_sim.drivers.catalogue import Driver, driver_names, make_driver
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.observation import Observation


class ScriptedExpertConfig(DriverConfig):
    """Parameters of scripted_expert."""

    driver: str = setting("expert", "driver: " + ", ".join(driver_names()))


class ScriptedExpertNode(SerdNode[ScriptedExpertConfig]):
    """Demonstrates while it is active."""

    config_class = ScriptedExpertConfig

    def configure(self) -> Activate:
        """Load the scenario and make the expert."""
        scenario = load_scenario(self.config.scenario)
        expert = make_driver(self.config.driver, scenario, self.config.seed)
        return partial(Demonstrating, scenario, expert, [])


class Demonstrating(Activity):
    """Steers by `intent`, as a person with arrow keys does."""

    def __init__(
        self, scenario: Scenario, expert: Driver, results: list[EpisodeResult], endpoints: Endpoints
    ) -> None:
        config = endpoints.node.config
        self._intents = endpoints.publisher(Vector3Stamped, topics.INTENT, qos.STATE)
        self.runner = EpisodeRunner(endpoints, config, scenario, expert, self._steer, results)

    def deactivate(self) -> None:
        """Discard the running episode."""
        self.runner.discard()

    def _steer(self, observation: Observation, action: Action) -> None:
        """Publish the intended direction."""
        self._intents.publish(to_intent(action, observation.time_s))
