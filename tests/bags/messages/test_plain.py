"""Decoded values equal those that rosbags serialized."""

import math

import pytest

from serd_bag.errors import BagError
from serd_bag.messages.plain import (
    decode,
    diagnostic_array,
    header_of,
    pose_position,
    yaw_of_quaternion,
)
from support.bag_messages import POSE, VECTOR


@pytest.mark.parametrize("little_endian", [True, False])
@pytest.mark.parametrize("frame", ["", "m", "map", "a/very/long/frame"])
def test_poses_and_vectors_read_as_written(messages, little_endian, frame):
    data = messages.pose(1.25, 3.5, -2.0, little_endian=little_endian, frame=frame)
    message = decode(data, POSE)
    header, turned = header_of(message.header), message.pose.orientation
    assert (header.stamp_ns, header.frame) == (1_250_000_000, frame)
    yaw_rad = yaw_of_quaternion(turned.x, turned.y, turned.z, turned.w)
    assert yaw_rad == pytest.approx(math.pi / 2)
    assert pose_position(data) == (1_250_000_000, 3.5, -2.0)
    message = decode(messages.intent(2.0, 0.0, -1.0, little_endian=little_endian), VECTOR)
    assert (message.vector.x, message.vector.y) == (0.0, -1.0)


def test_cut_messages_raise_at_every_length(messages):
    for read, data in (
        (pose_position, messages.pose(1.0, 2.0, 3.0)),
        (diagnostic_array, messages.mark(1.0, "end", 1, "arrived")),
    ):
        for length in range(len(data) - 3):
            with pytest.raises(BagError, match="must"):
                read(data[:length])
