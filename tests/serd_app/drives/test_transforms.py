"""Poses between the frames of recorded transforms."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from serd_app.drives.transforms import RecordedTransforms, inverse, matrices_of, planar
from serd_bag.messages.plain import Header, Transform

number = st.floats(-10, 10)


def transform(parent, child, time_s, x, y, yaw):
    turned = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return Transform(Header(round(time_s * 1e9), parent), child, (x, y, 0.0, *turned))


@given(st.lists(st.tuples(*[number] * 7), min_size=1, max_size=3))
def test_a_transform_is_that_of_scipy_and_its_inverse_cancels_it(rows):
    rows = np.array(rows)
    rows[np.linalg.norm(rows[:, 3:], axis=1) < 1e-6, 3:] = 0.0
    matrices = matrices_of(rows)
    turned = rows[:, 3:].any(axis=1)
    rotations = Rotation.from_quat(np.where(turned[:, None], rows[:, 3:], [0, 0, 0, 1])).as_matrix()
    np.testing.assert_allclose(matrices[:, :3, :3], rotations, atol=1e-12)
    np.testing.assert_array_equal(matrices[:, :3, 3], rows[:, :3])
    identity = np.broadcast_to(np.eye(4), matrices.shape)
    np.testing.assert_allclose(inverse(matrices) @ matrices, identity, atol=1e-12)


@given(st.lists(st.tuples(number, number, st.floats(-3.1, 3.1)), min_size=1, max_size=3))
def test_a_pose_in_the_plane_is_its_placement_seen_from_above(rows):
    np.testing.assert_allclose(planar(matrices_of(np.array(rows))), rows, atol=1e-12)


def test_poses_go_through_a_moving_and_a_static_frame():
    tree = RecordedTransforms({})
    tree.add(transform("map", "odom", 0.0, 1.0, 0.0, 0.0), static=False)
    tree.add(transform("map", "odom", 2.0, 1.0, 2.0, math.pi / 2), static=False)
    tree.add(transform("map", "other", 0.0, 0.0, 5.0, 0.0), static=True)
    numbers, times_s = np.array([[1.0, 0.0, 0.0]] * 3), np.array([0.0, 2.0, 1.0])
    poses = matrices_of(numbers)
    in_map = tree.placements("map", "odom", times_s) @ poses
    half = 0.5**0.5
    expected = [[2.0, 0.0, 0.0], [1.0, 3.0, math.pi / 2], [1.0 + half, 1.0 + half, math.pi / 4]]
    np.testing.assert_allclose(planar(in_map), expected, atol=1e-12)
    in_other = tree.placements("other", "odom", times_s[:2]) @ poses[:2]
    np.testing.assert_allclose(planar(in_other)[:, :2], [[2, -5], [1, -2]], atol=1e-12)
    back = tree.placements("odom", "map", times_s) @ in_map
    np.testing.assert_allclose(planar(back), numbers, atol=1e-12)
    beyond = tree.placements("map", "odom", np.array([-1.1, -0.9, 2.9, 3.1]))
    assert np.isnan(beyond[:, 0, 3]).tolist() == [True, False, False, True]


def test_a_camera_that_looks_forward_is_placed_in_space_not_in_the_plane():
    """Its optical frame has z forward and x to the right: 1 m ahead of a robot that looks north."""
    tree = RecordedTransforms({})
    tree.add(transform("map", "base", 0.0, 2.0, 3.0, math.pi / 2), static=True)
    optical = (-0.5, 0.5, -0.5, 0.5)
    tree.add(Transform(Header(0, "base"), "optical", (0.0, 0.0, 0.5, *optical)), static=True)
    ahead = np.array([0.0, 0.0, 1.0, 1.0])
    (placed,) = tree.placements("map", "optical", np.zeros(1)) @ ahead
    np.testing.assert_allclose(placed[:3], [2.0, 4.0, 0.5], atol=1e-12)
