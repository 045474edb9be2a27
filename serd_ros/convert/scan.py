"""Lidar ranges to and from sensor_msgs/LaserScan."""

import array

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan

from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from sim.scenario.settings import LidarSettings


def to_scan(ranges_m: NDArray[np.float32], settings: LidarSettings, time_s: float) -> LaserScan:
    """Ranges (n_rays,) counter-clockwise from angle_min; inf where nothing was hit."""
    message = LaserScan(
        angle_min=float(settings.angle_min_rad),
        angle_max=float(settings.angle_max_rad),
        angle_increment=float(settings.angle_increment_rad),
        scan_time=1.0 / float(settings.rate_hz),
        range_min=float(settings.range_min_m),
        range_max=float(settings.range_max_m),
        ranges=array.array("f", ranges_m.astype(np.float32).tobytes()),
    )
    message.header.frame_id = topics.BASE_FRAME
    message.header.stamp = to_stamp(time_s)
    return message


def ranges_of(message: LaserScan) -> NDArray[np.float32]:
    """(n_rays,) ranges."""
    return np.array(message.ranges, dtype=np.float32)
