"""Poses between the frames of recorded transforms."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from serd_app.drives.transforms import Poses, TransformTree
from serd_bag.messages.plain import Header, Transform

number = st.floats(-10, 10)
pose_of_numbers = st.tuples(number, number, number)


def transform(parent, child, time_s, x, y, yaw):
    turned = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return Transform(Header(round(time_s * 1e9), parent), child, (x, y, 0.0, *turned))


@given(pose_of_numbers, pose_of_numbers)
def test_a_transform_and_its_inverse_cancel(outer, inner):
    outer, inner = Poses.of_numbers(np.array([outer])), Poses.of_numbers(np.array([inner]))
    back = outer.inverse @ (outer @ inner)
    np.testing.assert_allclose(back.position_m, inner.position_m, atol=1e-9)
    np.testing.assert_allclose(back.rotation.as_matrix(), inner.rotation.as_matrix(), atol=1e-9)


def test_poses_go_through_a_moving_and_a_static_frame():
    tree = TransformTree()
    tree.add(transform("map", "odom", 0.0, 1.0, 0.0, 0.0), static=False)
    tree.add(transform("map", "odom", 2.0, 1.0, 2.0, math.pi / 2), static=False)
    tree.add(transform("map", "other", 0.0, 0.0, 5.0, 0.0), static=True)
    numbers, times_s = np.array([[1.0, 0.0, 0.0]] * 2), np.array([0.0, 2.0])
    poses = Poses.of_numbers(numbers)
    into_map = tree.into("map", "odom", poses, times_s)
    expected = [[2.0, 0.0, 0.0], [1.0, 3.0, math.pi / 2]]
    np.testing.assert_allclose(into_map.planar, expected, atol=1e-12)
    into_other = tree.into("other", "odom", poses, times_s)
    np.testing.assert_allclose(into_other.position_m[:, :2], [[2, -5], [1, -2]], atol=1e-12)
    back = tree.into("odom", "map", into_map, times_s)
    np.testing.assert_allclose(back.planar, numbers, atol=1e-12)


def test_a_camera_that_looks_forward_is_placed_in_space_not_in_the_plane():
    """Its optical frame has z forward and x to the right: 1 m ahead of a robot that looks north."""
    tree = TransformTree()
    tree.add(transform("map", "base", 0.0, 2.0, 3.0, math.pi / 2), static=True)
    optical = (-0.5, 0.5, -0.5, 0.5)
    tree.add(Transform(Header(0, "base"), "optical", (0.0, 0.0, 0.5, *optical)), static=True)
    ahead = Poses.of_numbers(np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]]))
    placed = tree.into("map", "optical", ahead, np.zeros(1))
    np.testing.assert_allclose(placed.position_m, [[2.0, 4.0, 0.5]], atol=1e-12)
