"""A reader asks for no more than every publisher offers, and loses no message by it."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSCompatibility, QoSProfile, ReliabilityPolicy
from rclpy.qos import qos_check_compatible as check_compatible
from std_msgs.msg import Int32

from serd_bag.formats.rosbag2.message_types import message_type, rosbags_types
from serd_bag.messages.plain import Header, Transform, transforms
from serd_ros.convert.frames import Frames
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import (
    FollowedTopic,
    PeopleTopic,
    TransformPublisher,
    follow_transforms,
)
from serd_ros.endpoints.qos import common_qos, less_demanding
from serd_ros.endpoints.robot import ObservationSource
from serd_ros.endpoints.topic_types import TF_TYPE, TopicType, message_class, raw_message_class
from serd_ros.settings import LocalisationConfig
from support.bag_messages import Messages
from support.nodes_in_process import node_in_process, other_participant
from support.people_messages import CLOUD, DETECTIONS, PEOPLE, TRACKED, PeopleMessages
from support.valid_messages import valid_message
from support.waiting import PATIENCE_S, wait_until

OFFERS = [
    QoSProfile(depth=5, reliability=reliability, durability=durability)
    for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
    for durability in (DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE)
]


def compatible(offered, asked):
    return check_compatible(offered, asked)[0] != QoSCompatibility.ERROR


def test_what_is_asked_for_hears_all_publishers_and_as_much_of_each_as_can_be():
    for first, second in product(OFFERS, OFFERS):
        asked = common_qos([first, second])
        assert compatible(first, asked)
        assert compatible(second, asked)
        is_less = less_demanding(second, first) is not second
        assert is_less == (not compatible(first, second))
    assert common_qos([qos.LATCHED]).durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert common_qos([qos.STATE, qos.STATE]).reliability == ReliabilityPolicy.RELIABLE


def publish(publisher, *numbers):
    for number in numbers:
        publisher.publish(Int32(data=number))
    assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE_S))


def test_messages_that_wait_are_taken_before_a_subscription_requests_less(running):
    node, taken = running.node, []
    node.endpoints.subscribe(Int32, "number", taken.append, qos.STATE)
    reliable = node.create_publisher(Int32, "number", qos.STATE)
    wait_until(reliable.get_subscription_count)
    publish(reliable, 1, 2, 3)
    node.create_publisher(Int32, "number", qos.SENSOR)
    wait_until(lambda: node.count_publishers("number") == 2)
    running.call_timers()
    assert [each.data for each in taken] == [1, 2, 3]
    (left,) = running.subscriptions("number")
    assert left.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    running.assert_alive()


def test_a_latched_subscription_stays_beside_one_for_volatile_publishers(running):
    node = running.node
    node.endpoints.subscribe(Int32, "number", lambda _: None, qos.LATCHED)
    for profile in (qos.LATCHED, qos.STATE):
        node.create_publisher(Int32, "number", profile)
    wait_until(lambda: node.count_publishers("number") == 2)
    for _ in range(2):
        running.call_timers()
        found = [each.qos_profile for each in running.subscriptions("number")]
        assert [qos.is_latched(each) for each in found] == [True, False]
    running.assert_alive()


def test_a_followed_topic_receives_what_latched_publishers_kept_and_then_all(running):
    node, taken = running.node, []
    latched = node.create_publisher(Int32, "number", qos.LATCHED)
    latched.publish(Int32(data=1))
    volatile = node.create_publisher(Int32, "number", qos.STATE)
    wait_until(lambda: node.count_publishers("number") == 2)
    kind = TopicType("std_msgs/msg/Int32")
    followed = FollowedTopic(
        node.endpoints, "/number", kind, lambda each: taken.append(each.data[4])
    )

    def take_waiting():
        for each in followed.waiting():
            followed.take(each)

    assert followed.look()
    # The publisher keeps one message: the next one would replace it before it is delivered.
    wait_until(lambda: 1 in taken, turn=take_waiting)
    assert not followed.look()
    wait_until(lambda: volatile.get_subscription_count() == 1, turn=take_waiting)
    latched.publish(Int32(data=2))
    wait_until(lambda: 2 in taken, turn=take_waiting)
    volatile.publish(Int32(data=3))
    wait_until(lambda: 3 in taken, turn=take_waiting)
    assert sorted(taken) == [1, 2, 3]


@pytest.fixture
def running():
    with node_in_process("teleop_mux") as found:
        yield found
        found.assert_alive()


def test_what_has_stopped_is_named_and_no_difference_of_clocks(running):
    config = LocalisationConfig(stamp_tolerance_s=0.3)
    source = ObservationSource(
        running.node.endpoints, 0.05, lambda _: None, config, needs_people=False
    )

    def missing_after(topic, time_s):
        running.receive(topic, valid_message(topic, time_s))
        return source._missing()

    missing_after("robot_pose", 100.0)
    (missing,) = missing_after("odom", 109.0)
    assert missing.startswith("odom is 9.000 s newer than robot_pose; at most")
    running.wait(9.0)
    gone = "stopped 9 s ago: look at what publishes it"
    assert missing_after("odom", 109.0) == [f"robot_pose {gone}"]
    missing_after("robot_pose", 109.0)
    running.wait(9.0)
    assert missing_after("robot_pose", 118.0) == [f"odom {gone}"]


def test_of_a_message_with_a_bad_transform_the_others_are_taken(running):
    node, changes = running.node, []
    follow_transforms(node.endpoints, lambda: changes.append(node.frames.names))
    node.create_publisher(raw_message_class(message_type(TF_TYPE)), topics.TF, qos.TF)
    wait_until(lambda: running.subscriptions("tf"), turn=running.call_timers)
    message = Messages().transforms(
        ("map", "odom", (math.nan, 0.0, 0.0), 1.0),
        ("odom", "moon", (3.8e8, 0.0, 0.0), 1.0),
        ("odom", "base_link", (2.0, 0.0, 0.0), 1.0),
    )
    running.receive("tf", message)
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


MADE = PeopleMessages()
START_M = np.array([[1.0, 2.0], [4.0, 0.5]])
WALKS_MPS = np.array([[0.5, -0.25], [0.0, 1.0]])
LYING = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


class Listening:
    """A node with a PeopleTopic, and publishers of the topic in another participant."""

    def __init__(self, running, other):
        self.running, self.other, self.taken = running, other, []
        self.topic = PeopleTopic(running.node.endpoints, "people", self.take)

    def take(self, time_ns, people):
        self.taken.append((time_ns, people))

    def publish_as(self, name):
        """A publisher of the type, by which the topic is received from now on."""
        kind = message_class(message_type(name))
        made = self.other.create_publisher(kind, "people", qos.STATE)
        self.look_until(lambda: self.is_received_as(name))
        return made

    def look_until(self, condition):
        wait_until(condition, turn=self.running.call_timers)

    def is_received_as(self, name):
        found = self.running.subscriptions("people")
        return [each.msg_type.__name__ for each in found] == [name.rpartition("/")[2]]

    def receive(self, name, step, count=2, **look):
        time_s = 100.0 + 0.1 * step
        there = (START_M + 0.1 * step * WALKS_MPS)[:count], WALKS_MPS[:count]
        self.running.receive("people", MADE.encode(name, time_s, *there, **look))


@pytest.fixture
def listening():
    with node_in_process("teleop_mux") as running:
        domain = running.node.context.get_domain_id()
        with other_participant("detector", domain) as other:
            yield Listening(running, other)


@pytest.mark.parametrize("name", [PEOPLE, TRACKED, DETECTIONS])
def test_people_are_received_as_the_type_of_their_publishers(listening, name):
    assert listening.is_received_as(CLOUD)
    publisher = listening.publish_as(name)
    listening.receive(name, 0)
    if name == DETECTIONS:  # those of an id that is new stand
        assert not listening.taken[-1][1].velocity_mps.any()
    for step in range(1, 10):
        listening.receive(name, step)
    time_ns, people = listening.taken[-1]
    assert time_ns == 100_900_000_000
    np.testing.assert_allclose(people.position_m, START_M + 0.9 * WALKS_MPS, atol=1e-9)
    np.testing.assert_allclose(people.velocity_mps, WALKS_MPS, atol=1e-9)
    assert len(set(people.identity)) == 2
    assert people.identity.tolist() == listening.taken[0][1].identity.tolist()
    listening.other.destroy_publisher(publisher)
    listening.publish_as(CLOUD)
    listening.running.receive("people", valid_message("pedestrians", 5.0))
    assert listening.taken[-1][0] == 5_000_000_000
    listening.running.assert_alive()


def test_people_in_the_frame_of_a_camera_are_brought_into_the_map(listening):
    """An optical frame, whose z axis lies, 2 m to the east: x is east and y is down."""
    listening.publish_as(PEOPLE)
    listening.receive(PEOPLE, 0, frame="optical")
    assert not listening.taken
    assert "joined with it by /tf, got 'optical'" in str(listening.running.rejected)
    lying = Transform(Header(0, "map"), "optical", (2.0, 0.0, 0.0, *LYING))
    listening.running.node.frames.take(lying, static=True)
    listening.receive(PEOPLE, 0, frame="optical")
    people = listening.taken[-1][1]
    np.testing.assert_allclose(people.position_m, [[3.0, 0.0], [6.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(people.velocity_mps, [[0.5, 0.0], [0.0, 0.0]], atol=1e-9)


def test_people_seen_from_a_robot_that_drives_are_where_they_were_at_their_stamp(listening):
    """They come before the transform of their stamp, and wait for it for a second."""
    running, node = listening.running, listening.running.node
    follow_transforms(node.endpoints)
    node.create_publisher(raw_message_class(message_type(TF_TYPE)), topics.TF, qos.TF)
    wait_until(lambda: running.subscriptions("tf"), turn=running.call_timers)

    def drive_to(time_s):
        place = ("map", "camera", (10.0 * (time_s - 100.0), 0.0, 0.0), time_s)
        running.receive("tf", Messages().transforms(place))

    drive_to(100.0)
    listening.publish_as(PEOPLE)
    listening.receive(PEOPLE, 1, frame="camera")
    assert not listening.taken
    drive_to(100.04)
    assert not listening.taken
    drive_to(100.14)
    (people,) = [people for _, people in listening.taken]
    expected_m = START_M + 0.1 * WALKS_MPS + [1.0, 0.0]
    np.testing.assert_allclose(people.position_m, expected_m, atol=1e-6)
    listening.receive(PEOPLE, 9, frame="camera")
    running.wait(1.1)
    drive_to(100.2)
    assert "must reach the stamp of a message" in str(running.rejected["rejected.people"])
    assert len(listening.taken) == 1
    running.assert_alive()


def test_a_type_that_holds_no_people_is_named_until_one_that_does_is_published_beside_it(listening):
    """The name of the type that holds no people sorts first."""
    kind = raw_message_class(message_type("nav_msgs/msg/Odometry"))
    other = listening.other.create_publisher(kind, "people", qos.STATE)
    listening.look_until(lambda: listening.topic.fault)
    sentence = "got nav_msgs/msg/Odometry; name the topic of people as people_topic"
    assert sentence in listening.topic.fault
    with other_participant("tracker", listening.running.node.context.get_domain_id()) as tracker:
        tracker.create_publisher(message_class(message_type(PEOPLE)), "people", qos.STATE)
        listening.look_until(lambda: listening.is_received_as(PEOPLE))
        assert not listening.topic.fault
    listening.look_until(lambda: listening.topic.fault)
    listening.other.destroy_publisher(other)
    listening.look_until(lambda: not listening.topic.fault)


def test_publishers_of_another_version_of_a_type_are_named_and_not_decoded(listening):
    """Detections of vision_msgs before version 4 have the same name and other fields."""
    older = replace(message_type(DETECTIONS), type_hash="RIHS01_" + "0" * 64)
    listening.other.create_publisher(raw_message_class(older), "people", qos.STATE)
    listening.look_until(lambda: listening.topic.fault)
    assert "install their version of vision_msgs here" in listening.topic.fault
    assert listening.is_received_as(CLOUD)
