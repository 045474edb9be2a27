"""The command as a person types it, and small recordings to give it."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_cli.main import main
from support.commands import Ended, work_in_empty_folder

POSE = "geometry_msgs/msg/PoseStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
CLOUD = "sensor_msgs/msg/PointCloud2"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_STORE = get_typestore(Stores.ROS2_JAZZY)
_START_S = 100.0
_STEP_S = 0.1


@pytest.fixture
def serd(monkeypatch, capsys, tmp_path) -> Callable[..., Ended]:
    """Runs `serd` with some words in an empty folder."""
    work_in_empty_folder(monkeypatch, tmp_path)

    def run(*words: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["serd", *map(str, words)])
        try:
            code = main()
        except SystemExit as ended:
            code = int(ended.code or 0)
        return Ended(code, *capsys.readouterr())

    return run


@pytest.fixture
def drive_bag(tmp_path) -> Callable[..., Path]:
    """Makes a bag of a robot driving north one cell per decision, for five decisions."""

    def make(name: str = "drive", *, intents: bool = True, x_m: float = 4.5, **topics: str) -> Path:
        pose, intent = topics.get("pose", "/robot_pose"), topics.get("intent", "/intent")
        with BagWriter(tmp_path / name) as writer:
            writer.add_topic(pose, POSE)
            writer.add_topic(intent, VECTOR)
            writer.add_topic("/episode", DIAGNOSTICS)
            writer.write("/episode", _mark(_START_S, "start"), _ns(_START_S))
            for step in range(101):
                time_s = _START_S + _STEP_S * step
                writer.write(pose, _pose(time_s, x_m, 1.5 + 0.05 * step), _ns(time_s))
                if intents and step % 20 == 0 and step < 100:
                    writer.write(intent, _north(time_s), _ns(time_s))
                if step % 10 == 9:
                    writer.flush()
            writer.write("/episode", _mark(time_s, "end"), _ns(time_s))
        return tmp_path / name

    return make


@pytest.fixture
def people_bag(drive_bag, tmp_path) -> Callable[[], Path]:
    """A drive during which one person walks north and another across the hallway to the east."""

    def make() -> Path:
        drive = drive_bag("before")
        with BagWriter(tmp_path / "people") as writer:
            writer.add_topic("/pedestrians", CLOUD)
            for topic in BagReader(drive).topics.values():
                writer.add_topic(topic.name, topic.type_name)
            for message in BagReader(drive).messages():
                writer.write(message.topic, message.data, message.log_time_ns)
            for step in range(30):
                time_s = _START_S + _STEP_S * step
                writer.write("/pedestrians", _people(time_s), _ns(time_s))
                writer.flush()
        return tmp_path / "people"

    return make


def _people(time_s: float) -> bytes:
    rows = np.array([[4.5, 8.5, 0.0, 1.0], [1.5, 8.5, 1.0, 0.0]], dtype="<f4")
    field = _STORE.types["sensor_msgs/msg/PointField"]
    names = ("x", "y", "vx", "vy")
    fields = [field(name, 4 * index, 7, 1) for index, name in enumerate(names)]
    data = np.frombuffer(rows.tobytes(), dtype=np.uint8)
    return _encoded(CLOUD, _header(time_s), 1, 2, fields, False, 16, 32, data, True)


def _ns(time_s: float) -> int:
    return round(time_s * 1e9)


def _encoded(type_name: str, *values: Any) -> bytes:
    return bytes(_STORE.serialize_cdr(_STORE.types[type_name](*values), type_name))


def _header(time_s: float) -> Any:
    stamp = _STORE.types["builtin_interfaces/msg/Time"](*divmod(_ns(time_s), 10**9))
    return _STORE.types["std_msgs/msg/Header"](stamp, "map")


def _pose(time_s: float, x_m: float, y_m: float) -> bytes:
    point = _STORE.types["geometry_msgs/msg/Point"](x_m, y_m, 0.0)
    level = _STORE.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    pose = _STORE.types["geometry_msgs/msg/Pose"](point, level)
    return _encoded(POSE, _header(time_s), pose)


def _north(time_s: float) -> bytes:
    vector = _STORE.types["geometry_msgs/msg/Vector3"](0.0, 1.0, 0.0)
    return _encoded(VECTOR, _header(time_s), vector)


def _mark(time_s: float, event: str) -> bytes:
    values = {"episode": "0", "driver": "anna", "seed": "1", "start_area": "train"}
    values["outcome"] = "arrived" if event == "end" else ""
    pairs = [_STORE.types["diagnostic_msgs/msg/KeyValue"](*pair) for pair in values.items()]
    status = _STORE.types["diagnostic_msgs/msg/DiagnosticStatus"](0, "episode", event, "", pairs)
    return _encoded(DIAGNOSTICS, _header(time_s), [status])
