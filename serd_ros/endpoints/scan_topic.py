"""Scans of any lidar, with the place that it has on the robot."""

from collections.abc import Callable

from rclpy.qos import QoSProfile
from sensor_msgs.msg import LaserScan

from serd_ros.convert.sensors import from_scan, scan_geometry_of
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.endpoints import Endpoints
from serd_ros.settings import LidarConfig
from serd_sim.safety.scan import Scan
from serd_sim.world.observation import Pose


class ScanTopic:
    """Calls back with (stamp_ns, scan) of each message of `scan`, whatever its frame is."""

    def __init__(
        self,
        endpoints: Endpoints,
        config: LidarConfig,
        take: Callable[[int, Scan], None],
        profile: QoSProfile = qos.SENSOR,
    ) -> None:
        self._frames, self._config, self._take = endpoints.node.frames, config, take
        endpoints.subscribe(LaserScan, topics.SCAN, self._on_scan, profile)

    def _on_scan(self, message: LaserScan) -> None:
        time_ns, ranges_m = from_scan(message, frame="")
        mount = self._mount_of(message.header.frame_id)
        self._take(time_ns, Scan(time_ns * 1e-9, ranges_m, scan_geometry_of(message), mount))

    def _mount_of(self, frame: str) -> Pose:
        """Where the lidar of a scan is in base_link."""
        config, frames = self._config, self._frames
        if frames.own(frame) == frames.own(config.scan_frame):
            return config.sensor_x, config.sensor_y, config.sensor_yaw
        return frames.place(frame, topics.BASE_FRAME).pose
