"""Bags and messages for the tests, made by the rosbags library as an independent judge."""

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from serd_bag.writer import BagWriter

POSE = "geometry_msgs/msg/PoseStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
TWIST = "geometry_msgs/msg/Twist"
STAMPED = "geometry_msgs/msg/TwistStamped"
TF = "tf2_msgs/msg/TFMessage"
#: Topics of our own recordings that decisions are made of.
OWN_TOPICS = {"/robot_pose": POSE, "/intent": VECTOR, "/episode": DIAGNOSTICS}


class Messages:
    """CDR bytes of standard messages, encoded by rosbags."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, type_name: str, *values: Any) -> Any:
        """A message object of rosbags."""
        return self.store.types[type_name](*values)

    def encode(self, message: Any, type_name: str, *, little_endian: bool = True) -> bytes:
        """Its CDR bytes."""
        data = self.store.serialize_cdr(message, type_name, little_endian=little_endian)
        return bytes(data)

    def header(self, time_s: float, frame: str = "map") -> Any:
        """A std_msgs/Header."""
        time_ns = round(time_s * 1e9)
        stamp = self.make("builtin_interfaces/msg/Time", time_ns // 10**9, time_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp, frame)

    def pose(self, time_s: float, x: float, y: float, **options: Any) -> bytes:
        """A PoseStamped turned by 90 degrees."""
        point = self.make("geometry_msgs/msg/Point", x, y, 0.0)
        turned = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.5**0.5, 0.5**0.5)
        pose = self.make("geometry_msgs/msg/Pose", point, turned)
        frame = options.pop("frame", "map")
        return self.encode(self.make(POSE, self.header(time_s, frame), pose), POSE, **options)

    def intent(self, time_s: float, east: float, north: float, **options: Any) -> bytes:
        """A Vector3Stamped."""
        vector = self.make("geometry_msgs/msg/Vector3", east, north, 0.0)
        return self.encode(self.make(VECTOR, self.header(time_s), vector), VECTOR, **options)

    def mark(
        self, time_s: float, event: str, episode: int, outcome: str = "", **more: str
    ) -> bytes:
        """A DiagnosticArray that begins or ends an episode."""
        values = {"episode": str(episode), "driver": "test", "outcome": outcome} | more
        pairs = [self.make("diagnostic_msgs/msg/KeyValue", *pair) for pair in values.items()]
        status = self.make("diagnostic_msgs/msg/DiagnosticStatus", 0, "episode", event, "t", pairs)
        array = self.make(DIAGNOSTICS, self.header(time_s), [status])
        return self.encode(array, DIAGNOSTICS)

    def twist(
        self, forward_mps: float, turn_radps: float = 0.0, stamp_s: float | None = None
    ) -> bytes:
        """A Twist, or a TwistStamped where it has a stamp."""
        rows = (forward_mps, 0.0, 0.0), (0.0, 0.0, turn_radps)
        speeds = self.make(TWIST, *(self.make("geometry_msgs/msg/Vector3", *row) for row in rows))
        if stamp_s is None:
            return self.encode(speeds, TWIST)
        return self.encode(self.make(STAMPED, self.header(stamp_s, ""), speeds), STAMPED)

    def transform(
        self, time_s: float, parent: str, child: str, x: float, y: float, yaw_rad: float = 0.0
    ) -> bytes:
        """A TFMessage of one transform."""
        turn = (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))
        moved = self.make(
            "geometry_msgs/msg/Transform",
            self.make("geometry_msgs/msg/Vector3", x, y, 0.0),
            self.make("geometry_msgs/msg/Quaternion", *turn),
        )
        joint = "geometry_msgs/msg/TransformStamped"
        stamped = self.make(joint, self.header(time_s, parent), child, moved)
        return self.encode(self.make(TF, [stamped]), TF)


def write_bag(path: Path, topics: dict[str, Any], rows: Iterable[tuple[str, float, bytes]]) -> Path:
    """A bag of the topics with their types and of messages (topic, log time in s, bytes)."""
    with BagWriter(path) as writer:
        for name, kind in topics.items():
            writer.add_topic(name, kind)
        for name, time_s, data in rows:
            writer.write(name, data, round(time_s * 1e9))
    return path


@pytest.fixture(scope="session")
def messages() -> Messages:
    """The encoder."""
    return Messages()


@pytest.fixture
def small_bag(tmp_path: Path, messages: Messages) -> Callable[..., Path]:
    """Makes a bag of 60 poses in several chunks, and intents among them; returns its folder."""

    def make(**options: Any) -> Path:
        folder = tmp_path / "small"
        with BagWriter(folder, **options) as writer:
            writer.add_topic("/robot_pose", POSE)
            writer.add_topic("/intent", VECTOR)
            for number in range(60):
                time_s = 10.0 + 0.05 * number
                time_ns = round(time_s * 1e9)
                writer.write("/robot_pose", messages.pose(time_s, number, 1.0), time_ns)
                if number % 7 == 0:
                    writer.write("/intent", messages.intent(time_s, 1.0, 0.0), time_ns)
                if number % 10 == 9:
                    writer.flush()
        return folder

    return make
