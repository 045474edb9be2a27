"""What a directive means to a planner, and when a live planner stands since its source is silent.

A directive is an action or a waypoint, with the stamp of the observation it was made for. It is
recent for 0.8 s, within which its source repeats it. An action is so, too, for the patience of the
scenario, until 0.3 s after the robot has entered another cell, where its source decides again: one
message drives it one cell on. No directive is recent more than a second before its stamp. Without a
recent one the robot brakes.
"""

import math

from serd_core.demonstrations.crossings import CellTracker
from serd_core.grid.grid import Action, Grid
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.epochs import hysteresis_m
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint, action_towards, waypoint_of_intent

_RECENT_S, _EARLY_S, _HANDOVER_S = 0.8, 1.0, 0.3
#: How often a source repeats its waypoint, s.
REPEAT_PERIOD_S = 0.2


def resolved(
    grid: Grid, observation: Observation, directive: Action | Waypoint
) -> tuple[Action, Waypoint | None]:
    """The action that a directive means, and where it leads; None to stand.

    A waypoint at the place of the robot means to wait.
    """
    if not isinstance(directive, Waypoint):
        return directive, waypoint_of_intent(grid, observation, directive)
    action = action_towards(directive, observation)
    return action, None if action == Action.WAIT else directive


class FollowedDirective:
    """The newest directive and the waypoint it means; WAIT means none."""

    def __init__(self, scenario: Scenario) -> None:
        self._grid = grid_of(scenario)
        self._longest_s = max(scenario.patience_s, _RECENT_S)
        self._cells = CellTracker(self._grid, hysteresis_m(self._grid))
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
            self._waypoint = resolved(self._grid, observation, directive)[1]
            self._until_s = given_s + (self._longest_s if is_action else _RECENT_S)
            self._is_new = False
        elif entered and is_action:
            self._until_s = min(self._until_s, observation.time_s + _HANDOVER_S)
        self._is_recent = given_s - _EARLY_S <= observation.time_s <= self._until_s
        return self._waypoint if self._is_recent else None
