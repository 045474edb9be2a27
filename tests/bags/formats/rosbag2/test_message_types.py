"""Definitions and hashes are those of the installation."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2 import message_types
from serd_bag.formats.rosbag2.message_types import message_type, share_folders

USED = [
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/Vector3Stamped",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/OccupancyGrid",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "diagnostic_msgs/msg/DiagnosticArray",
    "visualization_msgs/msg/MarkerArray",
    "rosgraph_msgs/msg/Clock",
    "tf2_msgs/msg/TFMessage",
]


@pytest.mark.parametrize("name", USED)
def test_the_text_alone_gives_the_hash(name):
    found = message_type(name)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(found.text, name))
    assert store.hash_rihs01(name) == found.type_hash
    assert get_typestore(Stores.ROS2_JAZZY).hash_rihs01(name) == found.type_hash


def test_the_text_is_the_installed_file_then_its_dependencies():
    text = message_type("geometry_msgs/msg/TwistStamped").text
    source = share_folders()[-1] / "geometry_msgs" / "msg" / "TwistStamped.msg"
    assert text.startswith(source.read_text())
    headers = [line for line in text.splitlines() if line.startswith("MSG: ")]
    assert headers == [
        "MSG: geometry_msgs/Twist", "MSG: geometry_msgs/Vector3",
        "MSG: std_msgs/Header", "MSG: builtin_interfaces/Time",
    ]  # fmt: skip
    assert text.count("\n" + "=" * 80 + "\n") == 4


def test_without_an_installation_the_carried_types_serve(monkeypatch):
    expected = message_type("geometry_msgs/msg/Twist").type_hash
    monkeypatch.setattr(message_types, "_interface_file", lambda *_: None)
    assert message_type.__wrapped__("geometry_msgs/msg/Twist").type_hash == expected


def test_a_sourced_installation_comes_first(monkeypatch, tmp_path):
    (tmp_path / "share").mkdir()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:/nowhere")
    assert share_folders()[0] == tmp_path / "share"


def test_an_unknown_type_gets_the_nearest():
    with pytest.raises(BagError, match="did you mean 'geometry_msgs/msg/PoseStamped'"):
        message_type("geometry_msgs/msg/PoseStampd")
    with pytest.raises(BagError, match="did you mean 'geometry_msgs/msg/Twist'"):
        message_type("geomtry_msgs/msg/Twst")
    with pytest.raises(BagError, match="must be written package/msg/Type"):
        message_type("geometry_msgs/Pose")
    with pytest.raises(BagError, match=r"install the package accel$"):
        message_type("accel/msg/Accel")
