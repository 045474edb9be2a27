"""The topics of a simulated robot: observation, scan, map, URDF, markers, diagnostics; clock."""

from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from serd_bag.files import read_text
from serd_ros.convert.markers import to_people_markers
from serd_ros.convert.sensors import to_occupancy_grid, to_scan
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import ObservationPublisher
from serd_ros.endpoints.transforms import TransformPublisher, publish_links
from serd_ros.graph.configs import HallwaySimConfig
from serd_ros.process.serd_node import SerdNode
from serd_sim.crowd.social_force import model_named
from serd_sim.robot.urdf import link_transforms
from serd_sim.scenario.occupancy import occupancy_raster
from serd_sim.world.observation import Observation
from serd_sim.world.world import HallwayWorld

#: Simulated time (s) between two reports of contacts that do not change.
_REPORT_PERIOD_S = 0.5


class ClockPublisher:
    """Publishes the time of the world. n_sent: messages so far."""

    def __init__(self, node: SerdNode[HallwaySimConfig]) -> None:
        self.n_sent = 0
        self._clock = node.create_publisher(Clock, topics.CLOCK, qos.CLOCK)

    def publish(self, time_s: float) -> None:
        """Send a time."""
        self.n_sent += 1
        self._clock.publish(Clock(clock=to_stamp(time_s)))


class WorldPublisher:
    """Publishes the present state of the world as a robot observes it.

    Scan and markers only while there are subscribers.
    """

    def __init__(self, node: SerdNode[HallwaySimConfig], world: HallwayWorld) -> None:
        self._node, self._world = node, world
        self._observation = ObservationPublisher(node)
        period_s = world.scenario.control_period_s
        self._ticks_per_report = max(1, round(_REPORT_PERIOD_S / period_s))
        self._reported: dict[str, float] | None = None
        self._scan = node.create_publisher(LaserScan, topics.SCAN, qos.STATE)
        self._people = node.create_publisher(MarkerArray, topics.MARKERS_PEOPLE, qos.STATE)
        self._transforms = TransformPublisher(node) if node.config.publish_tf else None
        self._map = node.create_publisher(OccupancyGrid, topics.MAP, qos.LATCHED)
        self._map.publish(to_occupancy_grid(occupancy_raster(world.scenario), 0.0))
        self._publish_description()
        self._person_radius_m = model_named(world.scenario.pedestrians.model).body_radius_m

    def _publish_description(self) -> None:
        """Send the URDF of the robot and where its links are."""
        path = self._world.scenario.robot.urdf_path
        publish_links(self._node, link_transforms(path, topics.BASE_FRAME))
        description = self._node.create_publisher(String, topics.ROBOT_DESCRIPTION, qos.LATCHED)
        description.publish(String(data=read_text(path)))

    def publish(self) -> None:
        """Send the world as it is now."""
        observation = self._world.observation
        if self._world.is_scan_tick:
            self._publish_rarely(observation)
        is_due = observation.tick % self._ticks_per_report == 0 or self._world.in_goal
        if is_due or self._counts() != self._reported:
            self._report()
        if self._transforms is not None:
            self._transforms.publish(
                observation.pose, self._world.odometry_pose, observation.time_s
            )
        self._observation.publish(observation, self._world.odometry_pose)

    def _publish_rarely(self, observation: Observation) -> None:
        if self._scan.get_subscription_count():
            ranges_m = self._world.scan(observation)
            self._scan.publish(to_scan(ranges_m, self._world.scenario.lidar, observation.time_s))
        if self._people.get_subscription_count():
            self._people.publish(
                to_people_markers(observation.people, self._person_radius_m, observation.time_s)
            )

    def _report(self) -> None:
        """Send the counts on `diagnostics`; at each change, which makes known those of a tick."""
        self._reported = self._counts()
        self._node.report(self._world.time_s, self._reported)

    def _counts(self) -> dict[str, float]:
        """Contacts and distances of the running episode."""
        contacts = self._world.contacts
        return {
            "robot_on_person": contacts.robot_on_person,
            "person_on_robot": contacts.person_on_robot,
            "robot_on_wall": contacts.robot_on_wall,
            "minimum_person_distance_m": self._world.minimum_person_distance_m,
            "rejected_commands": self._world.n_rejected_commands,
        }
