"""Shortest ways to the goal, against geometry by hand."""

import math

import numpy as np
import pytest

from serd_sim.scenario import shortest_way
from serd_sim.scenario.scenario import Scenario, load_scenario
from serd_sim.scenario.shortest_way import shortest_way_m

ROOM = {
    "name": "room",
    "walkable_area_m": [[0, 0], [10, 0], [10, 10], [0, 10]],
    "goal_area_m": [[8, 4], [10, 4], [10, 6], [8, 6]],
    "start_areas_m": {"train": [[0, 4], [2, 4], [2, 6], [0, 6]]},
    "pedestrians": {"count": 0},
}


def with_solid(*outline):
    solid = {"name": "solid", "outline_m": outline}
    return Scenario.model_validate(ROOM | {"obstacles": [solid]})


def test_round_a_wall_with_arcs_of_the_robots_radius_at_its_corners():
    wall = with_solid([4, 3], [6, 3], [6, 7], [4, 7])
    # Tangents to circles of 0.25 m around the corners (4, 7), (6, 7), from (1, 5) to (8, 6).
    expected = 0.0
    for along, up in ((3.0, 2.0), (2.0, 1.0)):
        far = math.hypot(along, up)
        expected += math.sqrt(far**2 - 0.25**2)
        turned = math.atan2(up, along) + math.asin(0.25 / far)
        expected += 0.25 * turned
    expected += 2.0
    assert shortest_way_m(wall, 1.0, 5.0) == pytest.approx(expected, rel=1e-3)


def test_a_gap_that_is_too_narrow_is_no_way():
    gap = 0.49
    low, high = [5, -1], [5.9, 9.6]
    walls = [
        {"name": "low", "outline_m": [low, [5.9, -1], [5.9, 4], [5, 4]]},
        {"name": "high", "outline_m": [[5, 4 + gap], [5.9, 4 + gap], high, [5, 9.6]]},
    ]
    closed = Scenario.model_validate(ROOM | {"obstacles": walls, "cell_size_m": gap})
    assert shortest_way_m(closed, 1.0, 5.0) == math.inf


def test_a_wall_without_thickness_is_gone_round():
    solid = with_solid([4.99, -1], [5.01, -1], [5.01, 8], [4.99, 8])
    spike = {"walkable_area_m": [[0, 0], [5, 0], [5, 8], [5, 0], [10, 0], [10, 10], [0, 10]]}
    thin = Scenario.model_validate(ROOM | spike)
    expected = shortest_way_m(solid, 1.0, 5.0)
    assert shortest_way_m(thin, 1.0, 5.0) == pytest.approx(expected, rel=1e-2)
    beyond = {"walkable_area_m": [[0, 0], [10, 0], [10, 10], [10, 15], [10, 10], [0, 10]]}
    outside = Scenario.model_validate(ROOM | beyond)
    assert shortest_way_m(outside, 1.0, 5.0) == pytest.approx(7.0)


@pytest.mark.parametrize("x_m", [3.0, 0.1])
def test_the_way_is_straight_and_from_within_the_radius_of_a_wall_starts_at_the_free_place(x_m):
    assert shortest_way_m(load_scenario("corridor"), x_m, 2.0) == pytest.approx(25.0)


def test_ways_over_the_raster_of_a_place_with_many_walls_are_at_most_3_percent_longer(monkeypatch):
    place = load_scenario("hallway")
    points_m = place.cells.centers_m[::29]
    exact_m = np.array([shortest_way_m(place, *point) for point in points_m])
    monkeypatch.setattr(shortest_way, "_MOST_CORNERS", 0)
    found_m = np.array([shortest_way_m(place, *point) for point in points_m])
    assert (found_m >= exact_m - 0.05).all()
    assert (found_m <= 1.03 * exact_m + 0.1).all()
    assert shortest_way_m(place.with_pedestrian_count(1), *points_m[0]) == found_m[0]
