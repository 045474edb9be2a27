"""The transforms of a simulated robot place its base where it is."""

import pytest

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.plain import transforms
from serd_ros.convert.frames import Frames
from serd_ros.endpoints.transforms import TF_TYPE, TransformPublisher, follow_transforms
from support.nodes_in_process import node_in_process
from support.waiting import wait_until

IN_MAP, IN_ODOM = (3.5, 6.5, 1.5), (1.0, -2.0, 0.5)


@pytest.mark.parametrize("prefix", ["", "robot1/"])
def test_the_base_is_in_the_map_where_the_pose_is_and_in_odom_where_the_wheels_are(prefix):
    with node_in_process("teleop_mux", frame_prefix=prefix) as running:
        publisher, sent = TransformPublisher(running.node.endpoints), []
        publisher._tf.publish = sent.append
        publisher.publish(IN_MAP, IN_ODOM, 7.0)
        assert not sent  # without a subscriber
        follow_transforms(running.node.endpoints)
        wait_until(publisher._tf.get_subscription_count, turn=running.call_timers)
        publisher.publish(IN_MAP, IN_ODOM, 7.0)
    (data,) = sent
    found = transforms(data, TF_TYPE, rosbags_types())
    assert [each.child for each in found] == [f"{prefix}odom", f"{prefix}base_link"]
    assert {each.header.stamp_ns for each in found} == {7_000_000_000}
    frames = Frames(prefix)
    for each in found:
        frames.take(each, static=False)
    assert frames.place("base_link", "map").pose == pytest.approx(IN_MAP)
    assert frames.place("base_link", "odom").pose == pytest.approx(IN_ODOM)
