"""How far rollouts stay from people and walls: gaps between surfaces, negative when they overlap.

Positions are arrays of any shape whose last axis is time.
"""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from sim.occupancy import WallDistanceRaster


def gap_to_people_m(
    x_m: FloatArray,
    y_m: FloatArray,
    people_x_m: FloatArray,
    people_y_m: FloatArray,
    reach_m: float,
) -> FloatArray:
    """Gap to the nearest of K people at each point; `reach_m` is the sum of the two radii.

    people_x_m, people_y_m: (K, T), or (K, 1) for people who stand.
    """
    nearest = np.full(x_m.shape, np.inf)
    for person_x, person_y in zip(people_x_m, people_y_m, strict=True):
        away_x, away_y = x_m - person_x, y_m - person_y
        away_x *= away_x
        away_y *= away_y
        away_x += away_y
        np.minimum(nearest, away_x, out=nearest)
    gap: FloatArray = np.sqrt(nearest, out=nearest)
    gap -= reach_m
    return gap


def gap_to_walls_m(
    x_m: FloatArray, y_m: FloatArray, walls: WallDistanceRaster, reach_m: float
) -> FloatArray:
    """Gap to the nearest wall at each point; `reach_m` is the robot's radius and a margin."""
    gap = walls.at(x_m, y_m)
    gap -= reach_m
    return gap


def cannot_stop_before(
    speed_mps: FloatArray, deceleration_mps2: float, time_s: FloatArray, reaction_s: float
) -> BoolArray:
    """(..., T) whether each time lies within the stopping time of the speeds plus one reaction."""
    stopping_s = np.abs(speed_mps) / deceleration_mps2 + reaction_s
    within: BoolArray = time_s <= stopping_s[..., None]
    return within
