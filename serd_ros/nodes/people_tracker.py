"""people_tracker: detects and tracks people in the scans of a robot, as a ROS 2 node.

At each pose of the robot it publishes `pedestrians`, predicted to the stamp of the pose. While the
scans are missing, old, mostly without ranges or frozen it publishes nothing, so that what relies on
people stops, and names the fault in the log and on `diagnostics`.
"""

from sensor_msgs.msg import PointCloud2

from serd_ros.convert.diagnostics import OK, WARN
from serd_ros.convert.sensors import to_people_message
from serd_ros.convert.stamp import Jump
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import ObservationSource
from serd_ros.endpoints.scan_topic import ScanTopic
from serd_ros.graph.configs import PeopleTrackerConfig
from serd_ros.process.managed_node import ManagedNode
from serd_sim.perception.lidar_people import LidarPeople
from serd_sim.safety.reasons import Fault, Reason, Source
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.observation import Observation

_LOG_PERIOD_S = 5.0


class PeopleTrackerNode(ManagedNode[PeopleTrackerConfig]):
    """Converts, calls `LidarPeople.step`, publishes `pedestrians`."""

    def configure(self) -> None:
        """Load the place."""
        self._scenario = load_scenario(self.config.scenario)
        limits = self.config.limits(self._scenario)
        self._people = LidarPeople(self._scenario, limits, self.config.wall_margin)

    def activate(self) -> None:
        """Track from now on."""
        self._people.reset()
        self._fault: Fault | None = None
        self._publisher = self.create_publisher(PointCloud2, topics.PEDESTRIANS, qos.STATE)
        ScanTopic(self, self.config, lambda _, scan: self._people.take_scan(scan))
        ObservationSource(
            self,
            self._scenario.control_period_s,
            self._on_observation,
            self.config,
            needs_people=False,
        )

    def clock_jumped(self, _: Jump) -> None:
        """Track anew."""
        self._people.reset()

    def _on_observation(self, observation: Observation) -> None:
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
            self.get_logger().warning(warning, throttle_duration_sec=_LOG_PERIOD_S)
        if fault is not self._fault:
            self._fault = fault
            self.report(time_s, {"scan": text or "ok"}, level=WARN if fault else OK, message=text)
