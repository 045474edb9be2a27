"""Waypoints, and the waypoint of each decision on the grid."""

import math
from dataclasses import dataclass

import numpy as np

from serd_core.demonstrations.crossings import CellTracker
from serd_core.grid.grid import Action, action_of_direction
from serd_sim.errors import SimError
from serd_sim.scenario.cells import WalkableCells
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.epochs import hysteresis_m
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


def waypoint_of_intent(
    cells: WalkableCells, observation: Observation, action: Action
) -> Waypoint | None:
    """Where a robot drives that is to go on in a direction; None to wait.

    The middle of a cell straight ahead, at least a metre beyond the next one, or of the last one
    before a wall: a robot that is to drive on does not brake for the next cell. Off the grid the
    way begins at the nearest cell.
    """
    if action == Action.WAIT:
        return None
    grid, x_m, y_m = cells.grid, observation.x_m, observation.y_m
    here = grid.state_at(x_m, y_m)
    if here < 0:
        here = int(np.argmin(np.hypot(*(cells.middles_m - (x_m, y_m)).T)))
    for _ in range(1 + math.ceil(_BEYOND_M / grid.cell_size_m)):
        here = int(grid.neighbours[here, action])
    x_m, y_m = cells.places_m[here, action].tolist()
    return Waypoint(x_m, y_m)


def action_towards(waypoint: Waypoint, observation: Observation) -> Action:
    """The direction in which a waypoint lies, WAIT where it is the place of the robot."""
    east_m, north_m = waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m
    away_m = math.hypot(east_m, north_m)
    if away_m <= _HERE_M:
        return Action.WAIT
    return action_of_direction(east_m / away_m, north_m / away_m)


_RECENT_S, _EARLY_S, _HANDOVER_S = 0.8, 1.0, 0.3
#: How often a source repeats its waypoint, s.
REPEAT_PERIOD_S = 0.2


def resolved(
    cells: WalkableCells, observation: Observation, directive: Action | Waypoint
) -> tuple[Action, Waypoint | None]:
    """The action that a directive means, and where it leads; None to stand.

    A waypoint at the place of the robot means to wait.
    """
    if not isinstance(directive, Waypoint):
        return directive, waypoint_of_intent(cells, observation, directive)
    action = action_towards(directive, observation)
    return action, None if action == Action.WAIT else directive


class FollowedDirective:
    """The newest directive and the waypoint it means; WAIT means none."""

    def __init__(self, scenario: Scenario) -> None:
        self._place, grid = scenario.cells, scenario.cells.grid
        self._longest_s = max(scenario.patience_s, _RECENT_S)
        self._cells = CellTracker(grid, hysteresis_m(grid))
        self.clear()

    def clear(self) -> None:
        """Discard directive and waypoint."""
        self._newest: tuple[float, Action | Waypoint] | None = None
        self._is_new, self._is_recent = False, True
        self.stand()

    def stand(self) -> None:
        """Discard the waypoint; the next directive gives another."""
        self._waypoint: Waypoint | None = None
        self._until_s = math.inf
        self._cells.reset()

    def take(self, time_s: float, directive: Action | Waypoint) -> None:
        """Follow a directive with this stamp from now on."""
        self._newest, self._is_new = (time_s, directive), True

    @property
    def is_given(self) -> bool:
        """Whether there is a directive."""
        return self._newest is not None

    @property
    def is_recent(self) -> bool:
        """Whether the directive counted at the last step."""
        return self._newest is not None and self._is_recent

    @property
    def is_overdue(self) -> bool:
        """Whether the robot stood at the last step since its directive was no longer recent."""
        is_motion = self._newest is not None and self._newest[1] != Action.WAIT
        return is_motion and not self._is_recent

    def age_s(self, observation: Observation) -> float:
        """Seconds since the stamp of the newest directive; infinite without one."""
        return math.inf if self._newest is None else observation.time_s - self._newest[0]

    def waypoint(self, observation: Observation) -> Waypoint | None:
        """Where to drive now, None to stand."""
        entered = self._cells.see(observation.time_s, observation.x_m, observation.y_m)
        if self._newest is None:
            return None
        given_s, directive = self._newest
        is_action = not isinstance(directive, Waypoint)
        if self._is_new:
            self._waypoint = resolved(self._place, observation, directive)[1]
            self._until_s = given_s + (self._longest_s if is_action else _RECENT_S)
            self._is_new = False
        elif entered and is_action:
            self._until_s = min(self._until_s, observation.time_s + _HANDOVER_S)
        self._is_recent = given_s - _EARLY_S <= observation.time_s <= self._until_s
        return self._waypoint if self._is_recent else None
