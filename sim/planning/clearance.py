"""How far rollouts stay from people and walls: gaps between surfaces, negative when they overlap.

Positions are arrays of any shape whose last axis is time.
"""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from sim.geometry.occupancy import WallDistanceRaster


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
    if x_m.size == x_m.shape[-1]:  # of one rollout, all people at once
        squared = np.square(x_m.ravel() - people_x_m) + np.square(y_m.ravel() - people_y_m)
        nearest = squared.min(axis=0, initial=np.inf).reshape(x_m.shape)
    else:  # of many, person by person: what is at hand then stays in the processor's cache
        nearest = np.full(x_m.shape, np.inf)
        away_x, away_y = np.empty(x_m.shape), np.empty(x_m.shape)
        for person_x, person_y in zip(people_x_m, people_y_m, strict=True):
            np.subtract(x_m, person_x, out=away_x)
            np.subtract(y_m, person_y, out=away_y)
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


def up_to_last(soon: BoolArray) -> BoolArray:
    """(N, n) of (N, T): the columns up to the last one that holds anything."""
    columns = np.flatnonzero(soon.any(axis=0))
    return soon[:, : columns[-1] + 1 if len(columns) else 0]
