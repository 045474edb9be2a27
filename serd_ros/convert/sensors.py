"""What is observed: people, lidar ranges and the map, to and from sensor_msgs and nav_msgs."""

import array
from collections.abc import Iterable

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

from serd_ros.convert.frames import NO_FRAMES, Frames
from serd_ros.convert.motion import to_pose
from serd_ros.convert.stamp import require_finite, require_frame, stamp_ns, to_header, to_stamp
from serd_ros.endpoints import topics
from serd_ros.errors import MessageError
from serd_sim.safety.scan import ScanGeometry
from serd_sim.scenario.occupancy import OccupancyRaster
from serd_sim.scenario.settings import LidarSettings
from serd_sim.world.observation import People

_NAMES = ("x", "y", "z", "vx", "vy")
#: Four times as many as the finest lidar of a robot, which has 0.02 degrees between rays.
_MOST_RAYS = 72_000
_ROW = np.dtype([(name, "<f4") for name in _NAMES] + [("id", "<i4")])
_KINDS = [*((name, PointField.FLOAT32) for name in _NAMES), ("id", PointField.INT32)]
_FIELDS = [
    PointField(name=name, offset=4 * index, datatype=kind, count=1)
    for index, (name, kind) in enumerate(_KINDS)
]


def to_people_message(people: People, time_s: float) -> PointCloud2:
    """The people as a cloud in the map."""
    rows = np.zeros(len(people.identity), dtype=_ROW)
    rows["x"], rows["y"] = people.position_m[:, 0], people.position_m[:, 1]
    rows["vx"], rows["vy"] = people.velocity_mps[:, 0], people.velocity_mps[:, 1]
    rows["id"] = people.identity
    return PointCloud2(
        header=to_header(topics.MAP_FRAME, time_s),
        height=1,
        width=len(rows),
        fields=_FIELDS,
        is_bigendian=False,
        point_step=_ROW.itemsize,
        row_step=_ROW.itemsize * len(rows),
        data=array.array("B", rows.tobytes()),
        is_dense=True,
    )


def from_people_message(message: PointCloud2, frames: Frames = NO_FRAMES) -> tuple[int, People]:
    """(stamp_ns, people in the map) of a cloud that has our layout; MessageError for any other."""
    layout = _layout(message.fields), message.point_step, bool(message.is_bigendian)
    if layout != (_layout(_FIELDS), _ROW.itemsize, False):
        names = ", ".join(field.name for field in message.fields)
        rule = f"pedestrians must have the fields {', '.join(_NAMES)}, id in {_ROW.itemsize} bytes"
        fix = "publish them as hallway_sim does"
        raise MessageError(rule, f"{names} in {message.point_step}", fix)
    size = message.width * _ROW.itemsize
    if (message.height, message.row_step, len(message.data)) != (1, size, size):
        received = (
            f"{len(message.data)} bytes, height {message.height}, width {message.width},"
            f" row_step {message.row_step}"
        )
        rule = "data must be one row of width * point_step bytes"
        raise MessageError(rule, received, "publish as many points as width states")
    rows = np.frombuffer(bytes(message.data), dtype=_ROW)
    for name in _NAMES:
        require_finite(name, rows[name])
    position_m = np.stack([rows["x"], rows["y"]], axis=1).astype(np.float64)
    velocity_mps = np.stack([rows["vx"], rows["vy"]], axis=1).astype(np.float64)
    if message.header.frame_id != topics.MAP_FRAME:
        matrix = frames.place(
            message.header.frame_id, topics.MAP_FRAME, at_ns=stamp_ns(message.header.stamp)
        ).matrix
        turn = matrix[:2, :2].T
        position_m, velocity_mps = position_m @ turn + matrix[:2, 3], velocity_mps @ turn
    identity = rows["id"].astype(np.int64)
    return stamp_ns(message.header.stamp), People(position_m, velocity_mps, identity)


def _layout(fields: Iterable[PointField]) -> list[tuple[str, int, int, int]]:
    """By value, since messages read from bags have types of their own."""
    return [(each.name, each.offset, each.datatype, each.count) for each in fields]


def to_scan(ranges_m: NDArray[np.float32], settings: LidarSettings, time_s: float) -> LaserScan:
    """Ranges (n_rays,) counter-clockwise from angle_min; inf where nothing was hit."""
    return LaserScan(
        header=to_header(topics.BASE_FRAME, time_s),
        angle_min=_single(settings.angle_min_rad),
        angle_max=_single(float(settings.angles_rad[-1])),
        angle_increment=_single(settings.angle_increment_rad),
        scan_time=_single(1.0 / settings.rate_hz),
        range_min=_single(settings.range_min_m),
        range_max=_single(settings.range_max_m),
        ranges=array.array("f", ranges_m.astype(np.float32).tobytes()),
    )


def _single(value: float) -> float:
    """As the message carries it."""
    return float(np.float32(value))


def from_scan(
    message: LaserScan, lidar: LidarSettings | None = None, *, frame: str = topics.BASE_FRAME
) -> tuple[int, NDArray[np.float32]]:
    """(stamp_ns, ranges (n_rays,)); single rays may be inf or nan.

    MessageError where rays and angles do not fit each other, or are not those of `lidar`.
    frame: that of the scan; any when empty.
    """
    require_frame(message.header, frame or message.header.frame_id)
    angles = message.angle_min, message.angle_max, message.angle_increment
    require_finite("angles", angles)
    require_finite("range_min and range_max", (message.range_min, message.range_max))
    n_rays = len(message.ranges)
    if n_rays > _MOST_RAYS:
        rule = f"ranges must have at most {_MOST_RAYS} rays"
        raise MessageError(rule, str(n_rays), "publish fewer rays")
    last_rad = message.angle_min + (n_rays - 1) * message.angle_increment
    step_rad = abs(message.angle_increment)
    # Many lidars name the end of a full turn, a step after their last ray, in single precision.
    if not n_rays or not step_rad or abs(last_rad - message.angle_max) > 1.5 * step_rad:
        rule = "ranges must have one ray per angle_increment from angle_min to angle_max"
        received = f"{n_rays} rays, angles {angles}"
        raise MessageError(rule, received, "correct the angles or the ranges")
    if lidar is not None:
        _require_lidar(message, lidar)
    return stamp_ns(message.header.stamp), np.array(message.ranges, dtype=np.float32)


def scan_geometry_of(message: LaserScan) -> ScanGeometry:
    """Angles and valid ranges of a scan; MessageError where no range can be valid."""
    if not 0.0 <= message.range_min < message.range_max:
        received = f"{message.range_max:g} and {message.range_min:g} m"
        rule = "range_max must be above range_min, and both at least 0"
        raise MessageError(rule, received, "set both in the driver of the lidar")
    return ScanGeometry(
        message.angle_min, message.angle_increment, message.range_min, message.range_max
    )


def _require_lidar(message: LaserScan, lidar: LidarSettings) -> None:
    received = len(message.ranges), message.angle_min, message.angle_increment
    expected = lidar.n_rays, lidar.angle_min_rad, lidar.angle_increment_rad
    if received[0] != expected[0] or not np.allclose(
        received[1:], expected[1:], rtol=0.0, atol=0.5 * lidar.angle_increment_rad / lidar.n_rays
    ):
        rule = (
            f"scan must have the {lidar.n_rays} rays of the scenario's lidar, angle_min"
            f" {expected[1]:g} and angle_increment {expected[2]:g}"
        )
        got = f"{received[0]} rays, {received[1]:g} and {received[2]:g}"
        raise MessageError(rule, got, "set lidar in the scenario to those of the sensor")


def to_occupancy_grid(raster: OccupancyRaster, time_s: float) -> OccupancyGrid:
    """Row 0 is the lowest y, as nav_msgs defines it; -1 unknown, 0 free, 100 occupied."""
    message = OccupancyGrid(header=to_header(topics.MAP_FRAME, time_s))
    message.info.map_load_time = to_stamp(time_s)
    message.info.resolution = float(raster.resolution_m)
    message.info.height, message.info.width = (int(n) for n in raster.cells.shape)
    message.info.origin = to_pose((raster.origin_m[0], raster.origin_m[1], 0.0))
    message.data = array.array("b", np.ascontiguousarray(raster.cells, dtype=np.int8).tobytes())
    return message
