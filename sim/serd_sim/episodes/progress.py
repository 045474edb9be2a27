"""Progress of an episode from its observations, in process or over ROS."""

import math
from typing import Literal

from serd_sim.scenario.goal import Area
from serd_sim.scenario.polygon import contains_point
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.observation import Observation

Ending = Literal["arrived", "timeout", "aborted"]


class EpisodeProgress:
    """Follows one episode from its first observation on. timeout_s: simulated seconds.

    goal_area_m: may be set to another area, for the following observations.
    """

    def __init__(self, scenario: Scenario, start: Observation, timeout_s: float) -> None:
        self.start = start
        self.distance_m = 0.0
        self._last = start
        self._period_s = scenario.control_period_s
        self.goal_area_m: Area = scenario.goal_area_m
        self._n_ticks = round(timeout_s / scenario.control_period_s)

    def see(self, observation: Observation) -> Ending | None:
        """Take the next observation; returns how the episode ends with it, None when it goes on."""
        before, self._last = self._last, observation
        self.distance_m += math.hypot(observation.x_m - before.x_m, observation.y_m - before.y_m)
        if contains_point(self.goal_area_m, observation.x_m, observation.y_m):
            return "arrived"
        return "timeout" if self.n_ticks >= self._n_ticks else None

    @property
    def n_ticks(self) -> int:
        """Control periods since the start."""
        return self._last.tick - self.start.tick

    @property
    def duration_s(self) -> float:
        """Simulated seconds since the start."""
        return self.n_ticks * self._period_s
