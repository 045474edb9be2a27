"""Which worlds of others keep a driver from beginning an episode."""

import pytest
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock

from serd_ros.endpoints import qos
from serd_ros.endpoints.worlds import several_worlds
from support.nodes_in_process import node_in_process
from support.waiting import wait_until


@pytest.mark.parametrize(
    ("kind", "topic", "profile", "pose_from", "is_ready"),
    [
        (Clock, "/clock", qos.CLOCK, "tf", True),
        (Clock, "/clock", qos.CLOCK, "robot_pose", True),
        (PoseStamped, "robot_pose", qos.STATE, "tf", True),
        (PoseStamped, "robot_pose", qos.STATE, "robot_pose", False),
    ],
)
def test_a_robot_without_a_simulator_depends_on_the_topics_that_it_follows(
    kind, topic, profile, pose_from, is_ready, save_model_of
):
    model = str(save_model_of())
    given = {"model": model, "reset": False, "pose_from": pose_from, "required_nodes": [""]}
    with node_in_process("strategy", **given) as running:
        for _ in range(2):
            running.node.create_publisher(kind, topic, profile)
        wait_until(lambda: several_worlds(running.node))
        node = running.node
        wait_until(
            lambda: node.ready or "one publisher of" in node._waited_for, turn=running.call_timers
        )
        assert node.ready == is_ready
