"""One drive written in the formats of other programs, where no real recording of them can be had.

The drive is our recording of the hallway: poses as recorded, velocity commands derived from them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.sessions import drives_in
from serd_bag.reader import BagReader
from serd_core.arrays import FloatArray

_ODOM, _TWIST, _TF = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "tf2_msgs/msg/TFMessage"
_ACKERMANN, _STEERED = (
    "ackermann_msgs/msg/AckermannDriveStamped",
    "ackermann_msgs/msg/AckermannDrive",
)
_STEERED_TEXT = (
    "float32 steering_angle\nfloat32 steering_angle_velocity\n"
    "float32 speed\nfloat32 acceleration\nfloat32 jerk"
)
_DRIVE_TEXT = f"std_msgs/Header header\n{_STEERED} drive"
ODOMETRY = "/odom"
_LONGEST_STEP_S = 0.5
_FIRST_S = 1.7e9


@dataclass(frozen=True, eq=False)
class Driven:
    """time_s (T,), x, y, yaw (T, 3), forward speed (T,): 0 across a gap between episodes."""

    time_s: FloatArray
    poses: FloatArray
    speed_mps: FloatArray


def driven_in(bag: Path) -> Driven:
    """The drive of one of our bags, or of another with a topic odom."""
    reader = BagReader(bag)
    if ODOMETRY in reader.topics:
        mapping = BagMapping(pose_topic=ODOMETRY, action_from="motion")
        return _driven(mapped_drive_in(reader, mapping, 1.0))
    (drive,) = drives_in(reader)
    return _driven(drive)


def _driven(drive: RecordedDrive) -> Driven:
    """With the heading along the motion, and real times."""
    step_m = np.diff(drive.position_m, axis=0, append=drive.position_m[-1:])
    step_s = np.diff(drive.pose_time_s, append=drive.pose_time_s[-1] + 1.0)
    usual = step_s < _LONGEST_STEP_S
    speed_mps = np.where(usual, np.hypot(*step_m.T) / step_s, 0.0)
    heading = np.arctan2(step_m[:, 1], step_m[:, 0])
    moving = usual & (speed_mps > 0.05)
    yaw_rad = pd.Series(np.where(moving, heading, np.nan)).ffill().fillna(0.0).to_numpy()
    poses = np.column_stack([drive.position_m, yaw_rad])
    return Driven(drive.pose_time_s - drive.pose_time_s[0] + _FIRST_S, poses, speed_mps)


class _Messages:
    """Messages of the drive by the types of a store; ros1: whether headers have a number."""

    def __init__(self, store: Typestore, *, ros1: bool) -> None:
        self._types, self._ros1 = store.types, ros1

    def odometry(self, time_s: float, pose: FloatArray, speed_mps: float) -> Any:
        inner = self._make(
            "geometry_msgs/msg/Pose", self._vector("Point", *pose[:2]), self._turn(pose)
        )
        zero = np.zeros(36)
        return self._make(
            _ODOM,
            self._header(time_s, "odom"),
            "base_link",
            self._make("geometry_msgs/msg/PoseWithCovariance", inner, zero),
            self._make(
                "geometry_msgs/msg/TwistWithCovariance", self.twist(time_s, pose, speed_mps), zero
            ),
        )

    def twist(self, _: float, __: FloatArray, speed_mps: float) -> Any:
        return self._make(_TWIST, self._vector("Vector3", speed_mps, 0.0), self._vector("Vector3"))

    def transform(self, time_s: float, pose: FloatArray, _: float) -> Any:
        moved = self._make(
            "geometry_msgs/msg/Transform", self._vector("Vector3", *pose[:2]), self._turn(pose)
        )
        header = self._header(time_s, "map")
        stamped = self._make("geometry_msgs/msg/TransformStamped", header, "base_link", moved)
        return self._make(_TF, [stamped])

    def steered(self, time_s: float, _: FloatArray, speed_mps: float) -> Any:
        drive = self._make(_STEERED, 0.0, 0.0, speed_mps, 0.0, 0.0)
        return self._make(_ACKERMANN, self._header(time_s, "base_link"), drive)

    def _make(self, name: str, *values: Any) -> Any:
        return self._types[name](*values)

    def _vector(self, name: str, x: float = 0.0, y: float = 0.0) -> Any:
        return self._make(f"geometry_msgs/msg/{name}", float(x), float(y), 0.0)

    def _turn(self, pose: FloatArray) -> Any:
        half = pose[2] / 2
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(half), np.cos(half))

    def _header(self, time_s: float, frame: str) -> Any:
        second = int(time_s)
        stamp = self._make("builtin_interfaces/msg/Time", second, int((time_s - second) * 1e9))
        number = (0,) if self._ros1 else ()
        return self._make("std_msgs/msg/Header", *number, stamp, frame)


def write_ros2(path: Path, drive: Driven, topics: dict[str, str], storage: StoragePlugin) -> Path:
    """A rosbag2 of rosbags."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(_STEERED_TEXT, _STEERED))
    store.register(get_types_from_msg(_DRIVE_TEXT, _ACKERMANN))
    with Ros2Writer(path, version=9, storage_plugin=storage) as writer:
        _write(writer, store, drive, topics, ros1=False)
    return path


def write_ros1(path: Path, drive: Driven, topics: dict[str, str]) -> Path:
    """A bag of ROS 1, compressed by bz2."""
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Ros1Writer(path)
    writer.set_compression(Ros1Writer.CompressionFormat.BZ2)
    with writer:
        _write(writer, store, drive, topics, ros1=True)
    return path


def _write(
    writer: Any, store: Typestore, drive: Driven, topics: dict[str, str], *, ros1: bool
) -> None:
    """Messages of the drive, in the order of time, to an open writer; topics: their types."""
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    messages = _Messages(store, ros1=ros1)
    makers: dict[str, Callable[[float, FloatArray, float], Any]] = {
        _ODOM: messages.odometry,
        _TWIST: messages.twist,
        _TF: messages.transform,
        _ACKERMANN: messages.steered,
    }
    to = {name: writer.add_connection(name, kind, typestore=store) for name, kind in topics.items()}
    for time_s, pose, speed_mps in zip(drive.time_s, drive.poses, drive.speed_mps, strict=True):
        for topic, kind in topics.items():
            message = makers[kind](float(time_s), pose, float(speed_mps))
            writer.write(to[topic], round(time_s * 1e9), serialise(message, kind))


def write_tum(path: Path, drive: Driven) -> Path:
    """Rows of time, place and quaternion."""
    half = drive.poses[:, 2] / 2
    zeros = np.zeros(len(half))
    columns = (drive.time_s, *drive.poses[:, :2].T, zeros, zeros, zeros, np.sin(half), np.cos(half))
    np.savetxt(path, np.column_stack(columns), fmt="%.6f")
    return path


def write_kitti(path: Path, drive: Driven) -> Path:
    """Matrices of camera poses, 10 rows per second: x to the right, z forward."""
    at_s = np.arange(drive.time_s[0], drive.time_s[-1], 0.1)
    yaw_rad = np.unwrap(drive.poses[:, 2])
    columns = (*drive.poses[:, :2].T, yaw_rad)
    x, y, yaw = (np.interp(at_s, drive.time_s, each) for each in columns)
    cos, sin, zero, one = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw), np.ones_like(yaw)
    rows = (sin, zero, cos, x, zero, one, zero, zero, -cos, zero, sin, y)
    np.savetxt(path, np.column_stack(rows), fmt="%.6e")
    return path


def people_of(path: Path) -> pd.DataFrame:
    """Frame, agent, x and y in m of a recording in PeTrack's format at 25 frames per second."""
    table = pd.read_csv(path, sep=r"\s+", comment="#", header=None).iloc[:, :4]
    table.columns = ["agent", "frame", "x", "y"]
    return table.assign(x=table["x"] / 100, y=table["y"] / 100)


def write_eth(path: Path, people: pd.DataFrame) -> Path:
    """Every tenth frame as ETH and UCY are annotated: frame, agent, x, y, by tabs."""
    kept = people[people["frame"] % 10 == 0].sort_values(["frame", "agent"])
    kept[["frame", "agent", "x", "y"]].to_csv(path, sep="\t", header=False, index=False)
    return path


def write_named(path: Path, people: pd.DataFrame) -> Path:
    """CSV or Parquet by the suffix, with names of columns and times in ms."""
    table = pd.DataFrame(
        {
            "track_id": people["agent"],
            "timestamp_ms": people["frame"] * 40,
            "x_center": people["x"],
            "y_center": people["y"],
        }
    )
    if path.suffix == ".parquet":
        table.to_parquet(path)
    else:
        table.to_csv(path, index=False)
    return path


TOPICS = {
    "twist": {"/odom": _ODOM, "/cmd_vel": _TWIST},
    "tf": {"/tf": _TF, "/cmd_vel": _TWIST},
    "steered": {"/odom": _ODOM, "/drive": _ACKERMANN},
}
