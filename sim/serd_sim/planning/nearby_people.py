"""The few people nearest to the robot, predicted by constant velocity."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
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


def distance_to_nearest(
    x_m: FloatArray, y_m: FloatArray, people_x_m: FloatArray, people_y_m: FloatArray
) -> FloatArray:
    """Distance from each point (..., T) to the nearest of K people, inf without any.

    people_x_m, people_y_m: (K, T), or (K, 1) for people who stand. A point (1,) is that of a robot
    that stands, at all times.
    """
    squared = np.full((*x_m.shape[:-1], max(x_m.shape[-1], people_x_m.shape[-1])), np.inf)
    for person_x, person_y in zip(people_x_m, people_y_m, strict=True):
        np.minimum(squared, np.square(x_m - person_x) + np.square(y_m - person_y), out=squared)
    distance: FloatArray = np.sqrt(squared, out=squared)
    return distance
