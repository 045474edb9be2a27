"""Plane geometry against closed forms."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from serd_sim.scenario.polygon import (
    contains,
    distance_to_segments_m,
    edges_of,
    signed_wall_distance_m,
    without_straight_corners,
)

L_SHAPE = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]


@given(x=st.floats(-3, 6), y=st.floats(-3, 6))
def test_distance_to_a_segment_is_that_to_a_brute_force_nearest_point(x, y):
    points = np.linspace(0, 1, 20001)[:, None] * (3.0, 1.0)
    found = distance_to_segments_m([[x, y]], np.array([[[0.0, 0.0], [3.0, 1.0]]]))
    assert found[0, 0] == pytest.approx(np.hypot(*(points - [x, y]).T).min(), abs=2e-4)


@given(cuts=st.lists(st.tuples(st.integers(0, 5), st.floats(0.01, 0.99)), max_size=12))
@example(cuts=[(0, 0.6440558819533597), (0, 0.6440558819533598)])  # the same point, by rounding
def test_a_wall_cut_into_pieces_is_put_together_again(cuts):
    pieces = []
    for number, (start, end) in enumerate(edges_of(L_SHAPE)):
        shares = sorted({share for edge, share in cuts if edge == number})
        pieces += [start, *(start + share * (end - start) for share in shares)]
    np.testing.assert_array_equal(without_straight_corners(np.array(pieces)), L_SHAPE)


def test_a_polygon_that_turns_everywhere_keeps_every_corner():
    angles = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    np.testing.assert_array_equal(without_straight_corners(circle), circle)
    spike = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [2.0, 5.0], [2.0, 2.0], [0.0, 2.0]])
    assert [2.0, 5.0] in without_straight_corners(spike).tolist()


@pytest.mark.parametrize(("seed", "count"), [(0, 1), (1, 7), (2, 900)])
def test_wall_distances_are_those_of_all_walls_to_the_last_bit(seed, count):
    rng = np.random.default_rng(seed)
    area = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 5.0], [4.0, 5.5], [0.0, 5.0]])
    triangle, corners = np.array([[0, 0], [1, 0.2], [0.3, 1]]), rng.uniform((0, 0), (8, 4), (12, 2))
    solids = [corner + rng.uniform(0.1, 2.0) * triangle for corner in corners]
    points = rng.uniform((-1.0, -1.0), (10.0, 6.0), (count, 2))
    walls = np.concatenate([edges_of(each) for each in (area, *solids)])
    free = contains(area, points) & ~np.any([contains(each, points) for each in solids], axis=0)
    nearest = distance_to_segments_m(points, walls).min(axis=1)
    found = signed_wall_distance_m(points, [area, *solids])
    np.testing.assert_array_equal(found, np.where(free, nearest, -nearest))
