"""People of each known type, received by the type that the publishers of their topic have."""

import math
from dataclasses import replace

import numpy as np
import pytest

from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.messages.plain import Header, Transform
from serd_ros.endpoints import qos
from serd_ros.endpoints.followed_topic import PeopleTopic
from serd_ros.endpoints.topic_types import message_class, raw_message_class
from support.nodes_in_process import deliver, node_in_process, other_participant
from support.people_messages import CLOUD, DETECTIONS, PEOPLE, TRACKED, PeopleMessages
from support.valid_messages import valid_message
from support.waiting import wait_until

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

    @property
    def subscriptions(self):
        return [each for each in self.running.node.subscriptions if each.topic_name == "/people"]

    def publish_as(self, name):
        """A publisher of the type, by which the topic is received from now on."""
        kind = message_class(message_type(name))
        made = self.other.create_publisher(kind, "people", qos.STATE)
        self.look_until(lambda: self.is_received_as(name))
        return made

    def look_until(self, condition):
        wait_until(condition, turn=self.running.call_timers)

    def is_received_as(self, name):
        return [each.msg_type.__name__ for each in self.subscriptions] == [name.rpartition("/")[2]]

    def receive(self, name, step, count=2, **look):
        time_s = 100.0 + 0.1 * step
        there = (START_M + 0.1 * step * WALKS_MPS)[:count], WALKS_MPS[:count]
        deliver(self.subscriptions[0], MADE.encode(name, time_s, *there, **look))


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


def test_detections_without_ids_are_tracked_also_over_messages_without_any(listening):
    listening.publish_as(DETECTIONS)
    for step in range(40):
        listening.receive(DETECTIONS, step, tracked=False)
        listening.receive(DETECTIONS, step + 0.5, count=0)
    people = listening.taken[-2][1]
    np.testing.assert_allclose(people.position_m, START_M + 3.9 * WALKS_MPS, atol=0.02)
    np.testing.assert_allclose(people.velocity_mps, WALKS_MPS, atol=0.02)
    assert len({tuple(people.identity) for _, people in listening.taken}) == 1
    listening.receive(DETECTIONS, 90.0, count=0)
    assert len(listening.taken[-1][1].identity) == 0


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
