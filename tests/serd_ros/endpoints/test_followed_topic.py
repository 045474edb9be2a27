"""A reader asks for no more than every publisher offers."""

import pytest
from rclpy.qos import DurabilityPolicy, QoSCompatibility, QoSProfile, ReliabilityPolicy
from rclpy.qos import qos_check_compatible as check_compatible

from serd_ros.endpoints import qos
from serd_ros.endpoints.followed_topic import common_qos, requests_too_much

OFFERS = [
    QoSProfile(depth=5, reliability=reliability, durability=durability)
    for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
    for durability in (DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE)
]


def compatible(offered, asked):
    return check_compatible(offered, asked)[0] != QoSCompatibility.ERROR


@pytest.mark.parametrize("first", OFFERS)
@pytest.mark.parametrize("second", OFFERS)
def test_what_all_offer_is_asked_for_and_hears_all_of_them(first, second):
    asked = common_qos([first, second])
    assert compatible(first, asked)
    assert compatible(second, asked)


@pytest.mark.parametrize("asked", OFFERS)
@pytest.mark.parametrize("offered", OFFERS)
def test_too_much_is_what_the_middleware_would_not_connect(asked, offered):
    assert requests_too_much(asked, offered) == (not compatible(offered, asked))


def test_the_most_there_is_is_asked_for():
    assert common_qos([qos.LATCHED]).durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert common_qos([qos.STATE, qos.STATE]).reliability == ReliabilityPolicy.RELIABLE
