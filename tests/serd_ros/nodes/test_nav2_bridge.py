"""nav2_bridge: poses and odometry in other frames become its transforms."""

import pytest

from serd_bag.formats.rosbag2.message_types import rosbags_types
from serd_bag.messages.plain import Header, Transform, transforms
from serd_ros.endpoints.transforms import TF_TYPE
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message
from support.waiting import wait_until

START = 100.0


@pytest.mark.usefixtures("nav2_server")
def test_pose_and_odometry_are_transformed_into_the_frames_of_its_tf():
    with node_in_process("nav2_bridge", publish_tf=True) as running:
        for parent, child in (("map", "world"), ("odom", "wheels")):
            placed = Transform(Header(0, parent), child, (10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
            running.node.frames.take(placed, static=True)
        odometry, pose = valid_message("odom", START), valid_message("robot_pose", START)
        odometry.header.frame_id, pose.header.frame_id = "wheels", "world"
        subscribed = running.work._transforms._tf.get_subscription_count
        wait_until(subscribed, turn=running.call_timers)  # by itself
        running.receive("odom", odometry)
        running.receive("robot_pose", pose)
        odom, base = transforms(running.sent["tf"], TF_TYPE, rosbags_types())
        assert base.placed[0] == odometry.pose.pose.position.x + 10.0
        assert (odom.header.frame, odom.child) == ("map", "odom")
        running.assert_alive()
