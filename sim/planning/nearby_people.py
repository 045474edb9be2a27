"""The few people a planner has to think about, predicted to walk straight on."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from sim.observation import Observation


@dataclass(frozen=True, eq=False)
class PredictedPeople:
    """x_m, y_m: (K, T) places of K people at the times asked for."""

    x_m: FloatArray
    y_m: FloatArray

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
    return PredictedPeople(
        x_m=position[:, 0, None] + velocity[:, 0, None] * time_s,
        y_m=position[:, 1, None] + velocity[:, 1, None] * time_s,
    )
