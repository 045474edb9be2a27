"""Definitions, hashes and quality of service are those of the installation, or of older bags."""

from dataclasses import replace

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2 import message_types
from serd_bag.formats.rosbag2.message_types import message_type, share_folders
from serd_bag.formats.rosbag2.qos import QosProfile, profile_to_offer, qos_of_text, qos_text


@pytest.mark.parametrize(
    "name",
    [
        "geometry_msgs/msg/PoseStamped",
        "nav_msgs/msg/Odometry",
        "sensor_msgs/msg/PointCloud2",
        "diagnostic_msgs/msg/DiagnosticArray",
        "visualization_msgs/msg/MarkerArray",
        "tf2_msgs/msg/TFMessage",
    ],
)
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


def test_a_sourced_installation_comes_first_and_without_one_the_carried_types_serve(
    monkeypatch, tmp_path
):
    name = "geometry_msgs/msg/Twist"
    expected = message_type(name).type_hash
    (tmp_path / "share").mkdir()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:/nowhere")
    assert share_folders()[0] == tmp_path / "share"
    monkeypatch.setattr(message_types, "share_folders", lambda: (tmp_path,))
    assert message_type.__wrapped__(name).type_hash == expected


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("geometry_msgs/msg/PoseStampd", "did you mean 'geometry_msgs/msg/PoseStamped'"),
        ("geometry_msgs/Pose", "must be written package/msg/Type"),
        ("accel/msg/Accel", r"install the package accel$"),
    ],
)
def test_an_unknown_type_gets_the_nearest(name, sentence):
    with pytest.raises(BagError, match=sentence):
        message_type(name)


@pytest.mark.parametrize(
    "profile",
    [
        QosProfile(),
        QosProfile(reliability="best_effort", depth=5),
        QosProfile(durability="transient_local", depth=1),
        QosProfile(history="keep_all"),
    ],
)
def test_quality_of_service_survives_the_way_into_a_bag_and_back(profile):
    assert qos_of_text(qos_text((profile,))) == (profile,)
    assert profile_to_offer((profile,)) == replace(profile, history="keep_last")


def test_quality_of_service_is_read_of_older_bags_and_reliable_where_it_is_damaged():
    old = "- history: 1\n  depth: 4\n  reliability: 2\n  durability: 1\n"
    assert qos_of_text(old) == (QosProfile("best_effort", "transient_local", depth=4),)
    for text in ("", "{", "3", "- 3", "- history: 3\n  depth: x"):
        assert len(qos_of_text(text)) <= 1
        assert profile_to_offer(qos_of_text(text)) == QosProfile()
