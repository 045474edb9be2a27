"""The map raster to nav_msgs/OccupancyGrid."""

import array

import numpy as np
from nav_msgs.msg import OccupancyGrid

from serd_ros.convert.pose import to_pose
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from sim.scenario.occupancy import OccupancyRaster


def to_occupancy_grid(raster: OccupancyRaster, time_s: float) -> OccupancyGrid:
    """Row 0 is the lowest y, as nav_msgs wants it; -1 unknown, 0 free, 100 occupied."""
    message = OccupancyGrid()
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    message.info.map_load_time = to_stamp(time_s)
    message.info.resolution = float(raster.resolution_m)
    message.info.height, message.info.width = (int(n) for n in raster.cells.shape)
    message.info.origin = to_pose((raster.origin_m[0], raster.origin_m[1], 0.0))
    message.data = array.array("b", np.ascontiguousarray(raster.cells, dtype=np.int8).tobytes())
    return message
