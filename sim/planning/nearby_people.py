"""The few people a planner has to think about, predicted to walk straight on."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from sim.world.observation import Observation


@dataclass(frozen=True, eq=False)
class PredictedPeople:
    """x_m, y_m: (K, T) places of K people at the times asked for; now_x_m, now_y_m: (K, 1)."""

    x_m: FloatArray
    y_m: FloatArray
    now_x_m: FloatArray
    now_y_m: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)

    def is_near(self, box_m: FloatArray, range_m: float) -> BoolArray:
        """(K,) who is now within a range of the box (x_min, x_max, y_min, y_max)."""
        x_min, x_max, y_min, y_max = box_m
        x_m, y_m = self.now_x_m[:, 0], self.now_y_m[:, 0]
        near: BoolArray = (x_m > x_min - range_m) & (x_m < x_max + range_m)
        near &= (y_m > y_min - range_m) & (y_m < y_max + range_m)
        return near


def predict_nearby(
    observation: Observation, range_m: float, most: int, time_s: FloatArray
) -> PredictedPeople:
    """Constant-velocity prediction of at most `most` people: the nearest within the range.

    Who is nowhere (not finite) is left out; who has no finite velocity is taken to stand.
    """
    away = observation.people_position_m - observation.pose[:2]
    squared = away[:, 0] ** 2 + away[:, 1] ** 2
    near = np.flatnonzero(squared < range_m**2)
    if len(near) > most:
        near = near[np.argsort(squared[near], kind="stable")[:most]]
    position, velocity = observation.people_position_m[near], observation.people_velocity_mps[near]
    velocity = np.where(np.isfinite(velocity).all(axis=1, keepdims=True), velocity, 0.0)
    now_x_m, now_y_m = position[:, :1], position[:, 1:]
    return PredictedPeople(
        x_m=now_x_m + velocity[:, :1] * time_s,
        y_m=now_y_m + velocity[:, 1:] * time_s,
        now_x_m=now_x_m,
        now_y_m=now_y_m,
    )
