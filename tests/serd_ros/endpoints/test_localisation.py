"""Poses by `amcl_pose` and odometry, and what a message of /tf with a bad transform leaves."""

import math

import pytest

from serd_bag.formats.rosbag2.message_types import message_type
from serd_ros.convert.pose import to_odometry
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.observation import ObservationSource
from serd_ros.endpoints.raw_type import raw_message_class
from serd_ros.endpoints.transforms import TF_TYPE, follow_transforms
from serd_ros.settings import LocalisationConfig
from support.nodes_in_process import deliver, node_in_process
from support.observations import observation_at
from support.transforms_message import transforms_message
from support.valid_messages import valid_message
from support.waiting import wait_until

START = 100.0


def odometry(running, time_s, pose):
    running.receive("odom", to_odometry(observation_at(0.0, 0.0, 0.0, time_s=time_s), pose))


@pytest.mark.parametrize("far", [(1.1, 0.0, 0.0), (0.0, 0.0, 1.1)])
def test_without_amcl_pose_odometry_is_followed_for_a_metre_or_a_radian(far):
    config = LocalisationConfig(pose_from="amcl_pose", stamp_tolerance_s=0.3)
    seen = []
    with node_in_process("teleop_mux") as running:
        source = ObservationSource(
            running.node.endpoints, 0.05, seen.append, config, needs_people=False
        )
        fault = source._localisation.fault
        odometry(running, START, (0.0, 0.0, 0.0))
        running.receive("amcl_pose", valid_message("amcl_pose", START))
        odometry(running, START + 0.1, (0.9, 0.0, 0.0))
        odometry(running, START + 0.2, (0.9, 0.0, 0.9))
        assert (len(seen), fault()) == (2, "")
        odometry(running, START + 0.3, far)
        odometry(running, START + 0.4, (0.0, 0.0, 0.0))
        assert len(seen) == 2
        assert "more than 1 m or 1 rad since the last amcl_pose" in fault()
        assert source._missing() == [fault()]
        running.receive("amcl_pose", valid_message("amcl_pose", START + 0.4))
        odometry(running, START + 0.5, (0.1, 0.0, 0.0))
        assert (len(seen), fault()) == (3, "")
        running.assert_alive()


def test_an_amcl_pose_that_comes_before_the_odometry_of_its_time_belongs_to_that():
    """As after a pause of the node, in which odometry was lost."""
    config = LocalisationConfig(pose_from="amcl_pose", stamp_tolerance_s=0.3)
    seen = []
    with node_in_process("teleop_mux") as running:
        source = ObservationSource(
            running.node.endpoints, 0.05, seen.append, config, needs_people=False
        )
        running.receive("amcl_pose", valid_message("amcl_pose", START))
        odometry(running, START, (0.0, 0.0, 0.0))
        running.receive("amcl_pose", valid_message("amcl_pose", START + 2.0))
        for step, angle_rad in enumerate((1.5, 1.7)):
            odometry(running, START + 2.0 + 0.1 * step, (3.0, 0.0, angle_rad))
        assert source._localisation.fault() == ""
        assert len(seen) == 3
        assert seen[1].pose == pytest.approx(seen[0].pose)
        assert seen[2].pose[2] - seen[1].pose[2] == pytest.approx(0.2)


def test_what_has_stopped_is_named_and_no_difference_of_clocks():
    config = LocalisationConfig(stamp_tolerance_s=0.3)
    with node_in_process("teleop_mux") as running:
        source = ObservationSource(
            running.node.endpoints, 0.05, lambda _: None, config, needs_people=False
        )
        running.receive("robot_pose", valid_message("robot_pose", START))
        odometry(running, START + 9.0, (0.0, 0.0, 0.0))
        assert source._missing()[0].startswith("odom is 9.000 s newer than robot_pose; at most")
        running.wait(9.0)
        odometry(running, START + 9.0, (0.0, 0.0, 0.0))
        gone = "stopped 9 s ago: look at what publishes it"
        assert source._missing() == [f"robot_pose {gone}"]
        running.receive("robot_pose", valid_message("robot_pose", START + 9.0))
        running.wait(9.0)
        running.receive("robot_pose", valid_message("robot_pose", START + 18.0))
        assert source._missing() == [f"odom {gone}"]


def test_of_a_message_with_a_bad_transform_the_others_are_taken():
    changes = []
    with node_in_process("teleop_mux") as running:
        node = running.node
        follow_transforms(node.endpoints, lambda: changes.append(node.frames.names))
        kind = raw_message_class(message_type(TF_TYPE))
        node.create_publisher(kind, topics.TF, qos.TF)

        def subscription():
            found = [each for each in node.subscriptions if each.topic_name == "/tf"]
            return found[0] if found else None

        received = wait_until(subscription, turn=running.call_timers)
        deliver(
            received,
            transforms_message(
                ("map", "odom", (math.nan, 0.0), (0.0, 1.0), 1.0),
                ("wheel", "tyre", (0.0, 0.0), (0.0, 3.0), 1.0),
                ("odom", "moon", (3.8e8, 0.0), (0.0, 1.0), 1.0),
                ("odom", "base_link", (2.0, 0.0), (0.0, 1.0), 1.0),
            ),
        )
        assert changes == [("base_link", "odom")]
        assert node.frames.place("base_link", "odom").pose == (2.0, 0.0, 0.0)
        assert "1 x transforms must be finite" in running.rejected["rejected.tf"]
        running.assert_alive()
