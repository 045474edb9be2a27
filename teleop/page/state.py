"""What changes on the page, twenty times a second."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from serd_core.grid.grid import Action
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint

_CENTIMETRES = 2
_MILLIRADIANS = 3


def world_state(
    observation: Observation, scenario: Scenario, ranges_m: NDArray[np.float32] | None
) -> dict[str, Any]:
    """Robot, people and scan; decided: how much of the decision period has passed, in [0, 1).

    Ranges that hit nothing are 0.
    """
    ticks = scenario.ticks_per_decision
    people = np.concatenate([observation.people_position_m, observation.people_velocity_mps], 1)
    return {
        "time_s": round(observation.time_s, _CENTIMETRES),
        "decided": round(observation.tick % ticks / ticks, _MILLIRADIANS),
        "robot": _rounded([*observation.pose, observation.speed_mps, observation.yaw_rate_radps]),
        "people": np.round(people, _CENTIMETRES).tolist(),
        "scan_m": None if ranges_m is None else scan_values(ranges_m),
    }


def scan_values(ranges_m: NDArray[np.float32]) -> list[float]:
    """(n_rays,) centimetres exact, 0 where nothing was hit."""
    seen = np.where(np.isfinite(ranges_m), ranges_m, 0.0).astype(np.float64)
    return [round(value, _CENTIMETRES) for value in seen.tolist()]


def point(waypoint: Waypoint | None) -> list[float] | None:
    """(x, y) in metres, None for none."""
    return None if waypoint is None else _rounded([waypoint.x_m, waypoint.y_m])


def word(action: Action) -> str:
    """north, east, south, west or wait."""
    return action.name.lower()


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(float(value), _MILLIRADIANS) for value in values]
