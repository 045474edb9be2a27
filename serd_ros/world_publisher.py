"""Everything the simulated world tells: clock, observation, scan, map and its own health."""

from nav_msgs.msg import OccupancyGrid
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan

from serd_ros import qos, topics
from serd_ros.configs import HallwaySimConfig
from serd_ros.convert.occupancy import to_occupancy_grid
from serd_ros.convert.scan import to_scan
from serd_ros.convert.stamp import to_stamp
from serd_ros.observation_endpoints import ObservationPublisher
from serd_ros.serd_node import SerdNode
from sim.decision import is_decision_tick
from sim.world import HallwayWorld


class WorldPublisher:
    """Publishes the world's present state; the scan only at its rate and when somebody listens."""

    def __init__(self, node: SerdNode[HallwaySimConfig], world: HallwayWorld) -> None:
        self._node, self._world = node, world
        self._clock = node.create_publisher(Clock, topics.CLOCK, qos.CLOCK)
        self._observation = ObservationPublisher(node)
        self._scan: Publisher = node.create_publisher(LaserScan, topics.SCAN, qos.STATE)
        self._map = node.create_publisher(OccupancyGrid, topics.MAP, qos.LATCHED)
        self._map.publish(to_occupancy_grid(world.map_raster(), 0.0))

    def publish(self) -> None:
        """Send the world as it is now."""
        observation = self._world.observation
        self._clock.publish(Clock(clock=to_stamp(observation.time_s)))
        if self._world.is_scan_tick and self._scan.get_subscription_count():
            ranges_m = self._world.scan(observation)
            self._scan.publish(to_scan(ranges_m, self._world.scenario.lidar, observation.time_s))
        if is_decision_tick(observation, self._world.scenario) or self._world.in_goal:
            self.report()
        self._observation.publish(observation, self._world.odometry_pose)

    def report(self) -> None:
        """Send contacts and distances of the running episode on `diagnostics`."""
        contacts = self._world.contacts
        self._node.report(
            self._world.time_s,
            {
                "robot_on_person": contacts.robot_on_person,
                "person_on_robot": contacts.person_on_robot,
                "robot_on_wall": contacts.robot_on_wall,
                "minimum_person_distance_m": float(self._world.minimum_person_distance_m),
                "rejected_commands": self._world.n_rejected_commands,
            },
        )
