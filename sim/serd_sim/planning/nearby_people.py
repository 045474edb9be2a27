"""The few people nearest to the robot, predicted by constant velocity."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.world.observation import Observation


@dataclass(frozen=True, eq=False)
class PredictedPeople:
    """x_m, y_m: (K, T) positions of K people at the given times; now_x_m, now_y_m: (K, 1)."""

    x_m: FloatArray
    y_m: FloatArray
    now_x_m: FloatArray
    now_y_m: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)


def near_box(
    x_m: FloatArray, y_m: FloatArray, box_m: tuple[float, float, float, float], range_m: float
) -> BoolArray:
    """(K,) whether each point is within a range of the box (x_min, x_max, y_min, y_max)."""
    x_min, x_max, y_min, y_max = box_m
    near: BoolArray = (x_m > x_min - range_m) & (x_m < x_max + range_m)
    near &= (y_m > y_min - range_m) & (y_m < y_max + range_m)
    return near


def predict_nearby(
    observation: Observation, range_m: float, most: int, time_s: FloatArray
) -> PredictedPeople:
    """Constant-velocity prediction of at most `most` people: the nearest within the range.

    People without a finite position are left out; those without a finite velocity stand.
    """
    position_m, velocity_mps = observation.people_position_m, observation.people_velocity_mps
    away_x, away_y = position_m[:, 0] - observation.x_m, position_m[:, 1] - observation.y_m
    squared = away_x * away_x + away_y * away_y
    near = (squared < range_m * range_m).nonzero()[0]
    if len(near) > most:
        near = near[squared[near].argsort(kind="stable")[:most]]
    position_m, velocity_mps = position_m[near], velocity_mps[near]
    finite = np.isfinite(velocity_mps)
    if not finite.all():
        velocity_mps = np.where(finite.all(axis=1, keepdims=True), velocity_mps, 0.0)
    now_x_m, now_y_m = position_m[:, :1], position_m[:, 1:]
    return PredictedPeople(
        now_x_m + velocity_mps[:, :1] * time_s,
        now_y_m + velocity_mps[:, 1:] * time_s,
        now_x_m,
        now_y_m,
    )


def gap_to_people_m(
    x_m: FloatArray,
    y_m: FloatArray,
    people_x_m: FloatArray,
    people_y_m: FloatArray,
    reach_m: float,
) -> FloatArray:
    """Gap to the nearest of K people at each point; `reach_m` is the sum of the two radii.

    people_x_m, people_y_m: (K, T), or (K, 1) for people who stand. One point is one of a robot that
    stands, at all times.
    """
    gap: FloatArray = distance_to_nearest(x_m, y_m, people_x_m, people_y_m)
    gap -= reach_m
    return gap


def distance_to_nearest(
    x_m: FloatArray, y_m: FloatArray, people_x_m: FloatArray, people_y_m: FloatArray
) -> FloatArray:
    """Distance from each point to the nearest person, inf without any (`gap_to_people_m`)."""
    if x_m.size == x_m.shape[-1]:  # one rollout: all people at once
        squared = np.square(x_m.ravel() - people_x_m) + np.square(y_m.ravel() - people_y_m)
        nearest = squared.min(axis=0, initial=np.inf).reshape(*x_m.shape[:-1], -1)
    else:  # many: person by person, which fits into the processor's cache
        nearest = np.full(x_m.shape, np.inf)
        away_x, away_y = np.empty(x_m.shape), np.empty(x_m.shape)
        for person_x, person_y in zip(people_x_m, people_y_m, strict=True):
            np.subtract(x_m, person_x, out=away_x)
            np.subtract(y_m, person_y, out=away_y)
            away_x *= away_x
            away_y *= away_y
            away_x += away_y
            np.minimum(nearest, away_x, out=nearest)
    distance: FloatArray = np.sqrt(nearest, out=nearest)
    return distance
