"""nav2_bridge: poses and odometry in other frames become its transforms."""

import pytest

from bags.messages.plain import Header, Transform
from support.nodes_in_process import node_in_process
from support.valid_messages import valid_message

START = 100.0


@pytest.mark.usefixtures("nav2_server")
def test_pose_and_odometry_are_transformed_into_the_frames_of_its_tf():
    with node_in_process("nav2_bridge", publish_tf=True) as running:
        for parent, child in (("map", "world"), ("odom", "wheels")):
            placed = Transform(Header(0, parent), child, (10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
            running.node.frames.take(placed, static=True)
        odometry, pose = valid_message("odom", START), valid_message("robot_pose", START)
        odometry.header.frame_id, pose.header.frame_id = "wheels", "world"
        running.receive("odom", odometry)
        running.receive("robot_pose", pose)
        in_map, in_odom = running.sent["tf"].transforms
        assert in_odom.transform.translation.x == odometry.pose.pose.position.x + 10.0
        assert (in_map.header.frame_id, in_map.child_frame_id) == ("map", "odom")
        running.assert_alive()
