"""What is observed: people, lidar ranges and the map, to and from sensor_msgs and nav_msgs."""

import array
from dataclasses import dataclass

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

from serd_ros.convert.pose import to_pose
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import topics
from serd_ros.errors import NodeError
from sim.scenario.occupancy import OccupancyRaster
from sim.scenario.settings import LidarSettings
from sim.world.observation import Observation

_NAMES = ("x", "y", "z", "vx", "vy")
_ROW = np.dtype([(name, "<f4") for name in _NAMES] + [("id", "<i4")])
_FIELDS = [
    PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
    for index, name in enumerate(_NAMES)
] + [PointField(name="id", offset=20, datatype=PointField.INT32, count=1)]


@dataclass(frozen=True, eq=False)
class People:
    """position_m, velocity_mps: (N, 2); identity: (N,)."""

    position_m: NDArray[np.float64]
    velocity_mps: NDArray[np.float64]
    identity: NDArray[np.int64]


NOBODY = People(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64))


def people_of(observation: Observation) -> People:
    """The people as they are observed."""
    return People(
        observation.people_position_m, observation.people_velocity_mps, observation.people_id
    )


def to_people_message(people: People, time_s: float) -> PointCloud2:
    """The people as a cloud in the map."""
    rows = np.zeros(len(people.identity), dtype=_ROW)
    rows["x"], rows["y"] = people.position_m[:, 0], people.position_m[:, 1]
    rows["vx"], rows["vy"] = people.velocity_mps[:, 0], people.velocity_mps[:, 1]
    rows["id"] = people.identity
    message = PointCloud2(
        height=1,
        width=len(rows),
        fields=_FIELDS,
        is_bigendian=False,
        point_step=_ROW.itemsize,
        row_step=_ROW.itemsize * len(rows),
        data=array.array("B", rows.tobytes()),
        is_dense=True,
    )
    message.header.frame_id = topics.MAP_FRAME
    message.header.stamp = to_stamp(time_s)
    return message


def from_people_message(message: PointCloud2) -> People:
    """The people of a cloud that has our layout; NodeError for any other."""
    names = tuple(field.name for field in message.fields)
    if names != (*_NAMES, "id") or message.point_step != _ROW.itemsize:
        raise NodeError(
            f"pedestrians must have the fields {', '.join(_NAMES)}, id in {_ROW.itemsize} bytes, "
            f"got {', '.join(names)} in {message.point_step}; publish them as hallway_sim does"
        )
    rows = np.frombuffer(bytes(message.data), dtype=_ROW)
    return People(
        position_m=np.stack([rows["x"], rows["y"]], axis=1).astype(np.float64),
        velocity_mps=np.stack([rows["vx"], rows["vy"]], axis=1).astype(np.float64),
        identity=rows["id"].astype(np.int64),
    )


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
