"""What lacks of an observation, and what a message of /tf with a bad transform leaves."""

import math

import pytest

from serd_bag.formats.rosbag2.message_types import message_type, rosbags_types
from serd_bag.messages.plain import transforms
from serd_ros.convert.frames import Frames
from serd_ros.convert.motion import to_odometry
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import TF_TYPE, TransformPublisher, follow_transforms
from serd_ros.endpoints.robot import ObservationSource
from serd_ros.endpoints.topic_types import raw_message_class
from serd_ros.settings import LocalisationConfig
from support.nodes_in_process import deliver, node_in_process
from support.observations import observation_at
from support.transforms_message import transforms_message
from support.valid_messages import valid_message
from support.waiting import wait_until

START = 100.0


class Located:
    """Observations of a node by a source of poses."""

    def __init__(self, running, **given):
        self.running, self.seen = running, []
        self.receive, self.wait = running.receive, running.wait
        config = LocalisationConfig(stamp_tolerance_s=0.3, **given)
        self.source = ObservationSource(
            running.node.endpoints, 0.05, self.seen.append, config, needs_people=False
        )

    def odometry(self, time_s, pose):
        self.receive("odom", to_odometry(observation_at(0.0, 0.0, 0.0, time_s=time_s), pose))

    def pose(self, topic, time_s):
        self.receive(topic, valid_message(topic, time_s))

    @property
    def state(self):
        return len(self.seen), self.source._localisation.fault()


@pytest.fixture
def running():
    with node_in_process("teleop_mux") as found:
        yield found
        found.assert_alive()


def test_what_has_stopped_is_named_and_no_difference_of_clocks(running):
    located = Located(running)
    located.pose("robot_pose", START)
    located.odometry(START + 9.0, (0.0, 0.0, 0.0))
    missing = located.source._missing
    assert missing()[0].startswith("odom is 9.000 s newer than robot_pose; at most")
    located.wait(9.0)
    located.odometry(START + 9.0, (0.0, 0.0, 0.0))
    gone = "stopped 9 s ago: look at what publishes it"
    assert missing() == [f"robot_pose {gone}"]
    located.pose("robot_pose", START + 9.0)
    located.wait(9.0)
    located.pose("robot_pose", START + 18.0)
    assert missing() == [f"odom {gone}"]


def test_of_a_message_with_a_bad_transform_the_others_are_taken(running):
    node, changes = running.node, []
    follow_transforms(node.endpoints, lambda: changes.append(node.frames.names))
    node.create_publisher(raw_message_class(message_type(TF_TYPE)), topics.TF, qos.TF)

    def subscription():
        found = [each for each in node.subscriptions if each.topic_name == "/tf"]
        return found[0] if found else None

    message = transforms_message(
        ("map", "odom", (math.nan, 0.0), (0.0, 1.0), 1.0),
        ("wheel", "tyre", (0.0, 0.0), (0.0, 3.0), 1.0),
        ("odom", "moon", (3.8e8, 0.0), (0.0, 1.0), 1.0),
        ("odom", "base_link", (2.0, 0.0), (0.0, 1.0), 1.0),
    )
    deliver(wait_until(subscription, turn=running.call_timers), message)
    assert changes == [("base_link", "odom")]
    assert node.frames.place("base_link", "odom").pose == (2.0, 0.0, 0.0)
    assert "1 x transforms must be finite" in running.rejected["rejected.tf"]


IN_MAP, IN_ODOM = (3.5, 6.5, 1.5), (1.0, -2.0, 0.5)


@pytest.mark.parametrize("prefix", ["", "robot1/"])
def test_the_transforms_of_a_simulated_robot_place_its_base_where_it_is(prefix):
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
