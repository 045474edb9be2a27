"""Whether the robot makes progress, by the rule of Nav2's SimpleProgressChecker."""

import math

from sim.world.observation import Observation


class ProgressChecker:
    """A robot is stuck that has not moved by the radius within the time allowance."""

    def __init__(self, required_movement_radius_m: float, movement_time_allowance_s: float) -> None:
        self.n_moves = 0
        self._radius_m = required_movement_radius_m
        self._allowance_s = movement_time_allowance_s
        self._place: tuple[float, float] | None = None
        self._since_s = 0.0

    def reset(self) -> None:
        """Start again with the next observation."""
        self._place = None

    def allow_more_time(self, observation: Observation) -> None:
        """Restart the time allowance, without counting a move."""
        self._since_s = observation.time_s

    def is_stuck(self, observation: Observation) -> bool:
        """Take an observation; returns whether the allowance has passed since the last move."""
        here = (observation.x_m, observation.y_m)
        if self._place is None or math.dist(here, self._place) > self._radius_m:
            self.n_moves += 1
            self._place, self._since_s = here, observation.time_s
        return observation.time_s - self._since_s > self._allowance_s
