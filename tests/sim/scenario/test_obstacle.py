"""Movable obstacles of a scenario: what is rejected, and how they are described."""

import math
import re

import numpy as np
import pytest
from pydantic import ValidationError

from sim.scenario.obstacle import Obstacle
from sim.scenario.scenario import Scenario
from storage.yaml_config import sentence_of
from support.movable_obstacles import CHAIR, DOOR, room

L_SHAPE = [[5, 5], [6, 5], [6, 5.2], [5.2, 5.2], [5.2, 6], [5, 6]]


@pytest.mark.parametrize(
    ("obstacle", "drive", "sentence"),
    [
        (
            CHAIR | {"mass_kg": 0},
            "physical",
            r"obstacles\[0\].mass_kg must be greater than 0, got 0",
        ),
        (
            DOOR | {"hinge_m": [4.9, 5]},
            "physical",
            r"obstacles\[0\]: hinge_m must lie inside or on outline_m, got \[4.9, 5.0\]; move it",
        ),
        (
            DOOR | {"mass_kg": None},
            "physical",
            r"obstacles\[0\]: mass_kg must be given where hinge_m is; add the mass of the door",
        ),
        (
            CHAIR | {"outline_m": L_SHAPE},
            "physical",
            r"obstacles\[0\]: outline_m must be convex where mass_kg is given",
        ),
        (
            CHAIR | {"outline_m": [[9, float("nan")], [9.4, 5], [9.4, 5.4], [9, 5.4]]},
            "physical",
            r"obstacles\[0\].outline_m\[0\]\[1\] must be a finite number, got nan",
        ),
        (
            DOOR | {"hinge_m": [float("inf"), 5]},
            "physical",
            r"obstacles\[0\].hinge_m\[0\] must be a finite number, got inf",
        ),
        (
            CHAIR,
            "kinematic",
            r"obstacles\[0\].mass_kg must be left out where robot.drive is kinematic, got 5; set"
            " robot.drive to physical",
        ),
        (
            CHAIR | {"outline_m": [[9.8, 5], [10.2, 5], [10.2, 5.4], [9.8, 5.4]]},
            "physical",
            r"obstacles\[0\].outline_m must be clear of the walls and of other obstacles",
        ),
        (
            CHAIR | {"outline_m": [[1, 1], [1.4, 1], [1.4, 1.4], [1, 1.4]]},
            "physical",
            r"obstacles\[0\].outline_m must keep clear of start_areas_m.train",
        ),
    ],
)
def test_a_bad_movable_obstacle_gets_a_sentence(obstacle, drive, sentence):
    with pytest.raises(ValidationError) as caught:
        room(obstacle, drive=drive)

    assert re.match(sentence, sentence_of(caught.value, Scenario))


def test_a_chair_between_two_others_must_not_overlap_them():
    with pytest.raises(ValidationError, match="clear of the walls and of other obstacles"):
        room(CHAIR, CHAIR | {"name": "other"})


def test_a_chair_must_not_stand_in_a_door():
    with pytest.raises(ValidationError, match="clear of the walls and of other obstacles"):
        room(CHAIR, DOOR)


def test_the_map_has_no_movable_obstacles():
    door = DOOR | {"outline_m": [[7, 5], [7.05, 5], [7.05, 6], [7, 6]], "hinge_m": [7.025, 6]}
    with_chair, bare = room(CHAIR, door), room()
    assert (with_chair.wall_segments_m == bare.wall_segments_m).all()
    assert len(with_chair.movable_obstacles) == 2


def test_outline_and_radius_of_gyration_of_a_rectangle():
    """(a^2 + b^2) / 12 about the middle, whatever the order of the corners."""
    corners = [(1.0, 2.0), (1.0, 2.6), (2.2, 2.6), (2.2, 2.0)]
    table = Obstacle(name="table", outline_m=corners, mass_kg=9)
    assert table.gyration_radius_m == pytest.approx(math.sqrt((1.2**2 + 0.6**2) / 12.0))
    assert table.pose == pytest.approx((1.6, 2.3, 0.0))
    turned = table.outline_at((0.0, 0.0, math.pi / 2))
    expected = np.array([(0.3, -0.6), (-0.3, -0.6), (-0.3, 0.6), (0.3, 0.6)])
    assert turned == pytest.approx(expected)
