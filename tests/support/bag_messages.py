"""Bags and messages for the tests, made by the rosbags library as an independent judge."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

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

    def filled(self, type_name: str, **given: Any) -> bytes:
        """CDR bytes of a message with these fields, which may be mappings, and zeros elsewhere."""
        return self.encode(filled(self.store, type_name, given), type_name)

    def pose(self, time_s: float, x: float, y: float, frame: str = "map", **options: Any) -> bytes:
        """A PoseStamped turned by 90 degrees."""
        turned = {"z": 0.5**0.5, "w": 0.5**0.5}
        given = {"position": {"x": x, "y": y}, "orientation": turned}
        message = {"header": self.header(time_s, frame), "pose": given}
        return self.encode(filled(self.store, POSE, message), POSE, **options)

    def intent(self, time_s: float, east: float, north: float, **options: Any) -> bytes:
        """A Vector3Stamped."""
        message = {"header": self.header(time_s), "vector": {"x": east, "y": north}}
        return self.encode(filled(self.store, VECTOR, message), VECTOR, **options)

    def mark(
        self, time_s: float, event: str, episode: int, outcome: str = "", **more: str
    ) -> bytes:
        """A DiagnosticArray that begins or ends an episode."""
        values = {"episode": str(episode), "driver": "test", "outcome": outcome} | more
        pairs = [{"key": key, "value": value} for key, value in values.items()]
        status = {"name": "episode", "message": event, "hardware_id": "t", "values": pairs}
        return self.filled(DIAGNOSTICS, header=self.header(time_s), status=[status])

    def twist(
        self, forward_mps: float, turn_radps: float = 0.0, stamp_s: float | None = None
    ) -> bytes:
        """A Twist, or a TwistStamped where it has a stamp."""
        speeds = {"linear": {"x": forward_mps}, "angular": {"z": turn_radps}}
        if stamp_s is None:
            return self.filled(TWIST, **speeds)
        return self.filled(STAMPED, header=self.header(stamp_s, ""), twist=speeds)

    def transform(
        self, time_s: float, parent: str, child: str, x: float, y: float, yaw_rad: float = 0.0
    ) -> bytes:
        """A TFMessage of one transform."""
        return self.transforms((parent, child, (x, y, yaw_rad), time_s))

    def transforms(self, *placed: tuple[str, str, tuple[float, float, float], float]) -> bytes:
        """A TFMessage of (parent, child, (x, y, yaw), time_s)."""
        joints = []
        for parent, child, (x, y, yaw_rad), time_s in placed:
            turn = {"z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
            moved = {"translation": {"x": x, "y": y}, "rotation": turn}
            header = self.header(time_s, parent)
            joints.append({"header": header, "child_frame_id": child, "transform": moved})
        return self.filled(TF, transforms=joints)


def filled(store: Typestore, type_name: str, given: Any) -> Any:
    """A message object of rosbags with the fields of a nested mapping, and zeros elsewhere."""
    if not isinstance(given, Mapping):
        return given

    def value(node: Nodetype, detail: Any, found: Any) -> Any:
        if node == Nodetype.NAME:
            return filled(store, detail, {} if found is None else found)
        if node == Nodetype.BASE:
            return ("" if detail[0] == "string" else 0) if found is None else found
        inner, length = detail
        if inner[0] == Nodetype.NAME or inner[1][0] == "string":
            return [value(*inner, each) for each in found or ()]
        return np.asarray(np.zeros(length) if found is None else found, dtype=inner[1][0])

    fields = store.fielddefs[type_name][1]
    return store.types[type_name](*(value(*kind, given.get(name)) for name, kind in fields))


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
