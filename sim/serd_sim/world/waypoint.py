"""Waypoints, and the waypoint of each decision on the grid."""

import math
from dataclasses import dataclass

import numpy as np

from serd_core.grid.grid import Action, Grid, action_of_direction
from serd_sim.errors import SimError
from serd_sim.world.observation import Observation

#: A waypoint this near (m) gives no direction.
_THERE_M = 0.05
#: One this near (m) is the place of the robot itself, after its way through a message.
_HERE_M = 1e-3
#: How far (m) the waypoint of an intent lies beyond the next cell, at least.
_BEYOND_M = 1.0
#: Squares of distances to one that is farther (m) overflow.
_FARTHEST_M = 1e100


@dataclass(frozen=True)
class Waypoint:
    """A point of the map; SimError where it is none."""

    x_m: float
    y_m: float

    def __post_init__(self) -> None:
        if not (abs(self.x_m) <= _FARTHEST_M and abs(self.y_m) <= _FARTHEST_M):
            raise SimError(
                f"a waypoint must be finite and at most {_FARTHEST_M:g} m from the origin, got"
                f" ({self.x_m}, {self.y_m}); give a point of the map"
            )


def heading_to(waypoint: Waypoint, observation: Observation) -> float:
    """Direction (rad) of the way to a waypoint; the robot's own where it has arrived there."""
    east_m, north_m = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
    if math.hypot(east_m, north_m) < _THERE_M:
        return observation.yaw_rad
    return math.atan2(north_m, east_m)


def waypoint_of_intent(grid: Grid, observation: Observation, action: Action) -> Waypoint | None:
    """Where a robot drives that is to go on in a direction; None to wait.

    The centre of a cell straight ahead, at least a metre beyond the next one, or of the last one
    before a wall: a robot that is to drive on does not brake for the next cell. Off the grid the
    way begins at the nearest cell.
    """
    if action == Action.WAIT:
        return None
    x_m, y_m = observation.x_m, observation.y_m
    here = grid.state_at(x_m, y_m)
    if here < 0:
        here = int(np.argmin(np.hypot(*(grid.centers_m - (x_m, y_m)).T)))
    for _ in range(1 + math.ceil(_BEYOND_M / grid.cell_size_m)):
        here = int(grid.neighbours[here, action])
    x_m, y_m = grid.centers_m[here].tolist()
    return Waypoint(x_m, y_m)


def action_towards(waypoint: Waypoint, observation: Observation) -> Action:
    """The direction in which a waypoint lies, WAIT where it is the place of the robot."""
    east_m, north_m = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
    away_m = math.hypot(east_m, north_m)
    if away_m <= _HERE_M:
        return Action.WAIT
    return action_of_direction(east_m / away_m, north_m / away_m)
