"""The few people a planner has to think about, predicted to walk straight on."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.observation import Observation


@dataclass(frozen=True, eq=False)
class PredictedPeople:
    """x_m, y_m: (K, T) places of K people at the times asked for; now_x_m, now_y_m: (K, 1)."""

    x_m: FloatArray
    y_m: FloatArray
    now_x_m: FloatArray
    now_y_m: FloatArray

    def __len__(self) -> int:
        return len(self.x_m)


def predict_nearby(
    observation: Observation, range_m: float, most: int, time_s: FloatArray
) -> PredictedPeople:
    """Constant-velocity prediction of at most `most` people: the nearest within the range."""
    away = observation.people_position_m - observation.pose[:2]
    squared = away[:, 0] ** 2 + away[:, 1] ** 2
    near = np.flatnonzero(squared < range_m**2)
    if len(near) > most:
        near = near[np.argsort(squared[near], kind="stable")[:most]]
    position, velocity = observation.people_position_m[near], observation.people_velocity_mps[near]
    now_x_m, now_y_m = position[:, :1], position[:, 1:]
    return PredictedPeople(
        x_m=now_x_m + velocity[:, :1] * time_s,
        y_m=now_y_m + velocity[:, 1:] * time_s,
        now_x_m=now_x_m,
        now_y_m=now_y_m,
    )
