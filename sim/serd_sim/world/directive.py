"""The waypoint that a live planner follows, and when it stands since its source is silent.

A directive is an action (one cell on) or a waypoint, with the stamp of the observation it was made
for. A waypoint may be far, so its source repeats it, and it is recent for 0.8 s. An action ends in
the next cell; it is recent for 1.5 times the longest of the last pauses between actions, 0.8 s at
least, and never beyond 1.5 decision periods. No directive is recent half a period before its
stamp. Without a recent one the robot brakes.
"""

import math
from collections import deque

from serd_core.grid.grid import Action
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint, waypoint_of_intent

_EARLY, _LATE = 0.5, 1.5
_SHORTEST_S = 0.8
#: Pauses between actions that count.
_N_PAUSES = 4
#: How often a source repeats its waypoint, s.
REPEAT_PERIOD_S = 0.2


class FollowedDirective:
    """The newest directive and the waypoint it means; WAIT means none."""

    def __init__(self, scenario: Scenario) -> None:
        self._grid = grid_of(scenario)
        self._period_s = scenario.decision_period_s
        self.clear()

    def clear(self) -> None:
        """Discard directive and waypoint."""
        self._newest: tuple[float, Action | Waypoint] | None = None
        self._pauses_s: deque[float] = deque(maxlen=_N_PAUSES)
        self._is_new, self._is_recent = False, True
        self.stand()

    def stand(self) -> None:
        """Discard the waypoint; the next directive gives another."""
        self._waypoint: Waypoint | None = None

    def take(self, time_s: float, directive: Action | Waypoint) -> None:
        """Follow a directive with this stamp from now on."""
        if self._newest is not None and time_s > self._newest[0]:
            self._pauses_s.append(time_s - self._newest[0])
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

    @property
    def patience_s(self) -> float:
        """How old (s) the newest directive may be."""
        if self._newest is not None and isinstance(self._newest[1], Waypoint):
            return _SHORTEST_S
        longest_s = _LATE * self._period_s
        usual_s = max(self._pauses_s, default=longest_s)
        return min(max(_LATE * usual_s, _SHORTEST_S), longest_s)

    def age_s(self, observation: Observation) -> float:
        """Seconds since the stamp of the newest directive; infinite without one."""
        return math.inf if self._newest is None else observation.time_s - self._newest[0]

    def waypoint(self, observation: Observation) -> Waypoint | None:
        """Where to drive now, None to stand."""
        if self._newest is None:
            return None
        if self._is_new:
            self._waypoint, self._is_new = self._resolve(observation, self._newest[1]), False
        age_s = self.age_s(observation)
        self._is_recent = -_EARLY * self._period_s <= age_s <= self.patience_s
        return self._waypoint if self._is_recent else None

    def _resolve(self, observation: Observation, directive: Action | Waypoint) -> Waypoint | None:
        if isinstance(directive, Waypoint):
            return directive
        if directive == Action.WAIT:
            return None
        return waypoint_of_intent(self._grid, observation, directive)
