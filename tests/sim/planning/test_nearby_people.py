"""Which people count, where they will be, and how near a rollout comes to them."""

import math

import numpy as np
import pytest

from serd_sim.planning.rollout_costs import distance_to_nearest, predict_nearby
from support.observations import observation_at

TIME_S = np.array([0.5, 1.0, 2.0])
RANGE_M = 5.0


def predicted(people, velocity=None, *, most=8):
    seen = observation_at(1.0, 2.0, people=people, velocity=velocity)
    return predict_nearby(seen, RANGE_M, most, TIME_S)


def now(people):
    """(K, 2) present positions."""
    return np.hstack([people.now_x_m, people.now_y_m]).tolist()


def test_people_within_the_range_count_and_those_at_it_do_not():
    """(4, 6) is 5 m from (1, 2); both coordinates of the others alone are within the range."""
    people = predicted([(4.0, 6.0), (3.75, 6.0), (4.0, 5.75), (-3.0, -2.0), (1.0, -2.75)])
    assert now(people) == [[3.75, 6.0], [4.0, 5.75], [1.0, -2.75]]


def test_of_too_many_people_the_nearest_count_and_of_equally_near_ones_the_first():
    crowd = [(4.0, 2.0), (1.0, 4.0), (1.5, 2.0), (-1.0, 2.0), (3.0, 2.0)]
    assert now(predicted(crowd, most=3)) == [[1.5, 2.0], [1.0, 4.0], [-1.0, 2.0]]
    assert now(predicted(crowd, most=5)) == [list(each) for each in crowd]
    two_places = predicted([(2.0, 2.0), (1.5, 2.0)] * 30, [(k, 0.0) for k in range(60)], most=40)
    first_of_each = [*range(1, 60, 2), *range(0, 20, 2)]
    assert (two_places.x_m - two_places.now_x_m)[:, 1].tolist() == first_of_each


def test_a_person_without_a_finite_position_is_left_out_and_one_without_a_velocity_stands():
    velocity = [(1.0, 1.0), (math.nan, 1.0), (1.0, math.inf), (1.0, 0.0)]
    people = predicted([(math.nan, 2.0), (2.0, 2.0), (2.0, 3.0), (2.0, 4.0)], velocity)
    assert now(people) == [[2.0, 2.0], [2.0, 3.0], [2.0, 4.0]]
    np.testing.assert_array_equal(people.x_m, [[2.0] * 3, [2.0] * 3, [2.5, 3.0, 4.0]])
    np.testing.assert_array_equal(people.y_m, [[2.0] * 3, [3.0] * 3, [4.0] * 3])


@pytest.mark.parametrize(("n_people", "n_times"), [(0, 1), (1, 4), (5, 1), (5, 4)])
def test_many_rollouts_have_the_distances_of_each_alone(n_people, n_times):
    rng = np.random.default_rng(4)
    x_m, y_m = rng.normal(size=(2, 3, 2, 4))
    people = rng.normal(size=(2, n_people, n_times))
    away_m = distance_to_nearest(x_m, y_m, *people)
    for index in np.ndindex(3, 2):
        each_m = np.hypot(x_m[index] - people[0], y_m[index] - people[1])
        np.testing.assert_allclose(away_m[index], each_m.min(axis=0, initial=np.inf), rtol=1e-12)
        np.testing.assert_array_equal(
            away_m[index], distance_to_nearest(x_m[index], y_m[index], *people)
        )
    standing_m = distance_to_nearest(x_m[0, 0, :1], y_m[0, 0, :1], *people)
    np.testing.assert_allclose(
        standing_m,
        np.hypot(x_m[0, 0, 0] - people[0], y_m[0, 0, 0] - people[1]).min(axis=0, initial=np.inf),
    )
