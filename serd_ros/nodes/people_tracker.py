"""people_tracker: detects and tracks people in the scans of a robot, as a ROS 2 node.

At each pose of the robot it publishes `pedestrians`, predicted to the stamp of the pose. While the
scans are missing, old, mostly without ranges or frozen it publishes nothing, so that what relies on
people stops, and names the fault in the log and on `diagnostics`.
"""

from functools import partial

from sensor_msgs.msg import PointCloud2

from serd_files.settings import setting, setting_of
from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.sensors import to_people_message
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.robot import ObservationSource, follow_scans
from serd_ros.process.serd_node import Activate, Activity, Endpoints, SerdNode
from serd_ros.settings import LidarConfig, LocalisationConfig, ManagedConfig
from serd_sim.episodes.episode import EpisodeSettings
from serd_sim.perception.scan_people import WALL_MARGIN_M, LidarPeople
from serd_sim.safety.reasons import Fault, Reason, Source
from serd_sim.safety.settings import GuardSettings
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.world.observation import Observation

_LOG_PERIOD_S = 5.0


class PeopleTrackerConfig(LocalisationConfig, LidarConfig, ManagedConfig):
    """Parameters of people_tracker."""

    scenario: str = setting_of(
        EpisodeSettings, "scenario", description="the place, whose walls are no people"
    )
    wall_margin: float = setting(
        WALL_MARGIN_M, "points nearer than this to a wall belong to it", unit="m", ge=0, le=1
    )
    source_timeout: float = setting_of(
        GuardSettings,
        "source_timeout",
        default=0.5,
        description="publish nothing when scans are older",
    )
    blind_rays: float = setting_of(
        GuardSettings, "blind_rays", description="publish nothing when more rays have no range"
    )

    def limits(self, scenario: Scenario) -> GuardSettings:
        """Limits of the scans as in the guard of the scenario's robot."""
        guard = GuardSettings.of_scenario(scenario, "scan")
        own = {"source_timeout": self.source_timeout, "blind_rays": self.blind_rays}
        return guard.model_copy(update=own)


class PeopleTrackerNode(SerdNode[PeopleTrackerConfig]):
    """Tracks people while it is active."""

    config_class = PeopleTrackerConfig

    def configure(self) -> Activate:
        """Load the place."""
        return partial(Tracking, load_scenario(self.config.scenario))


class Tracking(Activity):
    """Converts, calls `LidarPeople.step`, publishes `pedestrians`."""

    def __init__(self, scenario: Scenario, endpoints: Endpoints) -> None:
        self._node, config = endpoints.node, endpoints.node.config
        self._people = LidarPeople(scenario, config.limits(scenario), config.wall_margin)
        self._config, self._scenario = config, scenario
        self._fault: Fault | None = None
        self._publisher = endpoints.publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        follow_scans(endpoints, config, lambda _, scan: self._people.take_scan(scan))
        ObservationSource(
            endpoints, scenario.control_period_s, self._on_observation, config,
            on_jump=lambda _: self._people.reset(), needs_people=False,
        )  # fmt: skip

    def _on_observation(self, observation: Observation) -> None:
        if self._node.config is not self._config:
            self._config = self._node.config
            self._people.change(self._config.limits(self._scenario))
        seen = self._people.step(observation)
        if isinstance(seen, Fault):
            self._report_fault(seen, observation.time_s)
            return
        self._report_fault(None, observation.time_s)
        self._publisher.publish(to_people_message(seen, observation.time_s))

    def _report_fault(self, fault: Fault | None, time_s: float) -> None:
        """Log a fault, and publish it when it changes."""
        text = str(Reason(Source.SCAN, fault)) if fault else ""
        if fault:
            warning = f"{text}: no people are published"
            self._node.get_logger().warning(warning, throttle_duration_sec=_LOG_PERIOD_S)
        if fault is not self._fault:
            self._fault, level = fault, WARN if fault else OK
            self._node.report(time_s, {"scan": text or "ok"}, level=level, message=text)
