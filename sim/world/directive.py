"""The waypoint that a live planner follows, and where it stops when its source is silent.

A directive is an action (one cell on) or a waypoint, with the stamp of the observation it was made
for. It is recent while that stamp is at most 1.5 decision periods old, and at most half of one
ahead. A waypoint that is no longer recent is replaced by the nearest cell centre on the way to it.
"""

import math
from collections.abc import Iterator

from serd_core.grid.grid import Action
from sim.scenario.grid import grid_of
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint, waypoint_of_cell, waypoint_of_intent

_RECENT_PERIODS = (-0.5, 1.5)
#: A centre is on the way when reaching it shortens the way by at least this share of its distance.
_ON_THE_WAY = 0.5


class FollowedDirective:
    """The newest directive and the waypoint it means; WAIT means none."""

    def __init__(self, scenario: Scenario) -> None:
        self._grid = grid_of(scenario)
        self._is_recent = True
        self._period_s = scenario.decision_period_s
        self._brake_mps2 = scenario.robot.acc_lim_x_mps2
        self.clear()

    def clear(self) -> None:
        """Discard directive and waypoint."""
        self._newest: tuple[float, Action | Waypoint] | None = None
        self._is_new = False
        self.stand()

    def stand(self) -> None:
        """Discard the waypoint; the next directive gives another."""
        self._waypoint: Waypoint | None = None

    def take(self, time_s: float, directive: Action | Waypoint) -> None:
        """Follow a directive with this stamp from now on."""
        self._newest, self._is_new = (time_s, directive), True

    @property
    def is_given(self) -> bool:
        """Whether there is a directive."""
        return self._newest is not None

    @property
    def is_overdue(self) -> bool:
        """Whether the robot drives by a directive that was no longer recent at the last step."""
        return self._waypoint is not None and not self._is_recent

    def age_s(self, observation: Observation) -> float:
        """Seconds since the stamp of the newest directive; infinite without one."""
        return math.inf if self._newest is None else observation.time_s - self._newest[0]

    def waypoint(self, observation: Observation) -> Waypoint | None:
        """Where to drive now, None to stand."""
        if self._newest is None:
            return None
        was_recent, (low, high) = self._is_recent or self._is_new, _RECENT_PERIODS
        self._is_recent = low <= self.age_s(observation) / self._period_s <= high
        if self._is_new:
            self._waypoint, self._is_new = self._resolve(observation, self._newest[1]), False
        if was_recent and not self._is_recent and isinstance(self._newest[1], Waypoint):
            self._waypoint = self._shortened(observation)
        return self._waypoint

    def _resolve(self, observation: Observation, directive: Action | Waypoint) -> Waypoint | None:
        if isinstance(directive, Waypoint):
            return directive
        if directive == Action.WAIT:
            return None
        return waypoint_of_intent(self._grid, observation, directive)

    def _shortened(self, observation: Observation) -> Waypoint | None:
        """The nearest cell centre on the way at which the robot can stop, or the waypoint itself
        where it is as near; None where the way leads over no neighbouring cell."""
        waypoint = self._waypoint
        if waypoint is None:
            return None
        here = Waypoint(observation.x_m, observation.y_m)
        brakes_m = observation.speed_mps**2 / (2.0 * self._brake_mps2)
        left_m = _between_m(here, waypoint)
        ahead = [
            (away_m, centre)
            for centre in self._centres_around(observation)
            if (away_m := _between_m(here, centre)) >= brakes_m
            and left_m - _between_m(centre, waypoint) >= _ON_THE_WAY * away_m
        ]
        if left_m <= self._grid.cell_size_m:
            ahead.append((left_m, waypoint))
        return min(ahead, key=lambda each: each[0], default=(0.0, None))[1]

    def _centres_around(self, observation: Observation) -> Iterator[Waypoint]:
        here = self._grid.state_at(observation.x_m, observation.y_m)
        if here >= 0:
            for state in {here, *map(int, self._grid.neighbours[here])}:
                yield waypoint_of_cell(self._grid, state)


def _between_m(one: Waypoint, other: Waypoint) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
