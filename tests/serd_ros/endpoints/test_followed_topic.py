"""A reader asks for no more than every publisher offers, and loses no message by it."""

from itertools import product

import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSCompatibility, QoSProfile, ReliabilityPolicy
from rclpy.qos import qos_check_compatible as check_compatible
from std_msgs.msg import Int32

from serd_ros.endpoints import qos
from serd_ros.endpoints.followed_topic import FollowedTopic
from serd_ros.endpoints.qos import common_qos, less_demanding
from serd_ros.endpoints.topic_types import TopicType
from support.nodes_in_process import node_in_process
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


@pytest.fixture
def running():
    with node_in_process("teleop_mux") as found:
        yield found


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
    (left,) = [each for each in node.subscriptions if each.topic_name == "/number"]
    assert left.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
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
