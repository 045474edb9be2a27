"""The topics of a simulated robot: clock, observation, scan, map, URDF, markers, diagnostics."""

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
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.endpoints.observation import ObservationPublisher
from serd_ros.endpoints.transforms import TransformPublisher, publish_links
from serd_sim.crowd.social_force import model_named
from serd_sim.robot.urdf import link_transforms
from serd_sim.scenario.occupancy import occupancy_raster
from serd_sim.world.observation import Observation
from serd_sim.world.world import HallwayWorld

#: Simulated time (s) between two reports of contacts that do not change.
_REPORT_PERIOD_S = 0.5


class WorldPublisher:
    """Publishes the time of the world and its present state as a robot observes it.

    Scan and markers only while there are subscribers. with_tf: also as transforms. n_ticks: that
    were published.
    """

    def __init__(self, endpoints: Endpoints, world: HallwayWorld, *, with_tf: bool) -> None:
        self._node, self._world = endpoints.node, world
        self.n_ticks = 0
        self._clock = endpoints.publisher(Clock, topics.CLOCK, qos.CLOCK)
        self._observation = ObservationPublisher(endpoints)
        period_s = world.scenario.control_period_s
        self._ticks_per_report = max(1, round(_REPORT_PERIOD_S / period_s))
        self._reported: dict[str, float] | None = None
        self._scan = endpoints.publisher(LaserScan, topics.SCAN, qos.STATE)
        self._people = endpoints.publisher(MarkerArray, topics.MARKERS_PEOPLE, qos.STATE)
        self._transforms = TransformPublisher(endpoints) if with_tf else None
        self._map = endpoints.publisher(OccupancyGrid, topics.MAP, qos.LATCHED)
        self._map.publish(to_occupancy_grid(occupancy_raster(world.scenario), 0.0))
        self._publish_description(endpoints)
        self._person_radius_m = model_named(world.scenario.pedestrians.model).body_radius_m

    def _publish_description(self, endpoints: Endpoints) -> None:
        """Send the URDF of the robot and where its links are."""
        path = self._world.scenario.robot.urdf_path
        publish_links(endpoints, link_transforms(path, topics.BASE_FRAME))
        description = endpoints.publisher(String, topics.ROBOT_DESCRIPTION, qos.LATCHED)
        description.publish(String(data=read_text(path)))

    def publish(self) -> None:
        """Send the present tick: the clock, then what the robot observes."""
        self.n_ticks += 1
        self._clock.publish(Clock(clock=to_stamp(self._world.time_s)))
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
            scan = to_scan(ranges_m, self._world.scenario.lidar, observation.time_s)
            self._scan.publish(self._node.frames.prefixed(scan))
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
