"""A scenario on the coarse grid."""

import pytest

from serd_core.grid.grid import Action
from serd_sim.scenario.grid import flow_of, grid_of, wall_distance_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


@pytest.mark.parametrize(
    ("x_m", "y_m", "expected"),
    [
        (4.5, 8.5, Action.NORTH),
        (1.5, 8.5, Action.SOUTH),
        (9.5, 16.5, Action.EAST),
        (9.5, 19.5, Action.WEST),
    ],
)
def test_people_keep_right_and_left_hand_traffic_turns_every_flow_round(x_m, y_m, expected):
    assert flow_of(HALLWAY, GRID)[GRID.state_at(x_m, y_m)] == expected
    left = HALLWAY.model_copy(update={"flow_convention": "left_hand"})
    back = (expected + 1) % 4 + 1
    assert flow_of(left, GRID)[GRID.state_at(x_m, y_m)] == back


def test_there_is_no_flow_without_people():
    assert (flow_of(HALLWAY.with_pedestrian_count(0), GRID) == -1).all()


def test_wall_distance_in_the_middle_of_the_hallway_is_half_its_width_less_half_a_cell():
    distance = wall_distance_of(HALLWAY, GRID)
    assert distance[GRID.state_at(2.5, 10.5)] == pytest.approx(2.5)
    assert distance[GRID.state_at(0.5, 10.5)] == pytest.approx(0.5)
