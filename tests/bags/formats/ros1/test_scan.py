"""Bags of ROS 1 read as the messages of ROS 2, judged by rosbags, which converts them here."""

import pytest
from rosbags.convert import convert as convert_to_ros_1
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.rewrite import convert
from serd_bag.formats.rosbag2.message_types import message_type, store_of
from serd_bag.reader import BagReader
from serd_bag.topic import MessageType
from support.bag_messages import POSE, TF, TWIST, write_bag

START_S = 1_700_000_000
OWN = "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
USED = message_type(POSE).text.index("\n====")
TOPICS = {
    "/pose": POSE,
    "/cmd_vel": TWIST,
    "/tf": TF,
    "/state": MessageType("own_msgs/msg/State", OWN + message_type(POSE).text[USED:], ""),
}


@pytest.fixture
def both(tmp_path, messages):
    """8 s of a robot that drives east at 1 m/s, by ROS 2 and converted to ROS 1."""
    rows = []
    for number in range(81):
        time_s, x = START_S + number / 10, number / 10
        sent = (
            messages.pose(time_s, x, 0.5, frame="né"),
            messages.twist(1.0),
            messages.transform(time_s, "/odom", "/base_link", x, 0.5),
            messages.pose(time_s, x, 0.5),
        )
        rows += [(name, time_s, data) for name, data in zip(TOPICS, sent, strict=True)]
    write_bag(tmp_path / "new", TOPICS, rows)
    stores = (get_typestore(store) for store in (Stores.ROS2_JAZZY, Stores.ROS1_NOETIC))
    old = tmp_path / "drive.bag"
    convert_to_ros_1([tmp_path / "new"], old, "", 0, None, "none", *stores, (), (), (), ())
    return tmp_path / "new", old


def test_messages_are_those_of_ros_2_with_their_definitions(both, tmp_path):
    new, old = map(BagReader, both)
    assert list(old.messages()) == [
        message._replace(publish_time_ns=message.log_time_ns) for message in new.messages()
    ]
    assert old.topics["/pose"].message_type.type_hash == message_type(POSE).type_hash
    assert "own_msgs/msg/State" in store_of(old.topics["/state"]).fielddefs
    assert convert(both[1], tmp_path / "again").counts == dict.fromkeys(TOPICS, 81)
    assert list(BagReader(tmp_path / "again").messages()) == list(old.messages())
