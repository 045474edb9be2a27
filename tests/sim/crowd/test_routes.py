"""Where walkers head: a point ahead on their own line, and the next leg at its end."""

import numpy as np
import pytest

from serd_sim.crowd.routes import Routes

SQUARE = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])


def heading(x_m, y_m, share=0.01):
    routes = Routes([SQUARE])
    routes.place(np.array([share]))
    along, across = routes.headings(np.array([x_m]), np.array([y_m]))
    return along[0], across[0]


def test_who_is_beside_the_line_heads_for_a_point_five_metres_ahead_on_it():
    assert heading(4.0, 1.0) == pytest.approx(np.array([5.0, -1.0]) / np.sqrt(26.0))


def test_near_the_end_of_a_leg_its_corner_is_headed_for():
    assert heading(17.0, 1.0) == pytest.approx(np.array([3.0, -1.0]) / np.sqrt(10.0))


def test_at_the_end_of_a_leg_the_next_one_is_taken():
    east, north = heading(19.7, 0.0)
    assert north > 0.99
    assert east > 0.0


def test_people_are_placed_along_the_whole_loop_by_its_length():
    routes = Routes([SQUARE] * 4)
    x_m, y_m = routes.place(np.array([0.0, 0.125, 0.5, 0.9]))
    assert x_m == pytest.approx([0.0, 10.0, 20.0, 0.0])
    assert y_m == pytest.approx([0.0, 0.0, 20.0, 8.0])
