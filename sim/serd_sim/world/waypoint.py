"""Waypoints, the decision clock, and the waypoint of each decision on the grid."""

import math
from dataclasses import dataclass

from serd_core.grid.grid import Action, Grid
from serd_sim.errors import SimError
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

#: A waypoint this near (m) gives no direction.
_THERE_M = 0.05
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


def is_decision_tick(observation: Observation, scenario: Scenario) -> bool:
    """Whether a decision period begins at this observation."""
    return observation.tick % scenario.ticks_per_decision == 0


class DecisionClock:
    """The decision periods of a drive: each begins at the first observation in it.

    So observations of any rate and phase decide once in each period.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._ticks = scenario.ticks_per_decision
        self.begin()

    def begin(self, start_tick: int | None = None) -> None:
        """Count periods from a tick on, None for that of the next observation."""
        self._start = start_tick
        self._begun = -1, -1

    def begins(self, observation: Observation) -> bool:
        """Whether a period begins at this observation, or began at it when it came before."""
        if self._start is None:
            self._start = observation.tick
        period = (observation.tick - self._start) // self._ticks
        if period > self._begun[0]:
            self._begun = period, observation.tick
        return observation.tick == self._begun[1]


def heading_to(waypoint: Waypoint, observation: Observation) -> float:
    """Direction (rad) of the way to a waypoint; the robot's own where it has arrived there."""
    east_m, north_m = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
    if math.hypot(east_m, north_m) < _THERE_M:
        return observation.yaw_rad
    return math.atan2(north_m, east_m)


def waypoint_of_cell(grid: Grid, state: int) -> Waypoint:
    """Centre of a state's cell."""
    x_m, y_m = grid.centers_m[state]
    return Waypoint(x_m=float(x_m), y_m=float(y_m))


def waypoint_of_intent(grid: Grid, observation: Observation, action: Action) -> Waypoint:
    """Centre of the neighbouring cell in the chosen direction; where the robot is, to wait.

    Towards a wall it is the centre of the robot's own cell.
    """
    here = grid.state_at(observation.x_m, observation.y_m)
    if action == Action.WAIT or here < 0:
        return Waypoint(x_m=observation.x_m, y_m=observation.y_m)
    return waypoint_of_cell(grid, int(grid.neighbours[here, action]))
