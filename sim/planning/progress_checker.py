"""Whether the robot gets anywhere, as Nav2's SimpleProgressChecker asks it."""

import math
from dataclasses import dataclass

from sim.errors import SimError
from sim.world.observation import Observation


@dataclass(frozen=True)
class ProgressState:
    """What a snapshot keeps: moves counted, where and when the last one ended."""

    n_moves: int
    place: tuple[float, float] | None
    since_s: float


class ProgressChecker:
    """Stuck is who has not moved `required_movement_radius_m` in `movement_time_allowance_s`."""

    def __init__(
        self, required_movement_radius_m: float = 0.5, movement_time_allowance_s: float = 10.0
    ) -> None:
        if not (required_movement_radius_m > 0 and movement_time_allowance_s > 0):
            raise SimError(
                "required_movement_radius_m and movement_time_allowance_s must be above 0, got "
                f"{required_movement_radius_m} and {movement_time_allowance_s}; raise them"
            )
        self.n_moves = 0
        self._radius_m = required_movement_radius_m
        self._allowance_s = movement_time_allowance_s
        self._place: tuple[float, float] | None = None
        self._since_s = 0.0

    def reset(self) -> None:
        """Begin anew with the next observation."""
        self._place = None

    def snapshot(self) -> ProgressState:
        """Copy of all that changes."""
        return ProgressState(self.n_moves, self._place, self._since_s)

    def restore(self, state: ProgressState) -> None:
        """Go back to a snapshot."""
        self.n_moves, self._place, self._since_s = state.n_moves, state.place, state.since_s

    def allow_more_time(self, observation: Observation) -> None:
        """Grant another allowance from now on, without counting it as a move."""
        self._since_s = observation.time_s

    def is_stuck(self, observation: Observation) -> bool:
        """Take an observation; whether the allowance has run out since the last real move."""
        here = (observation.x_m, observation.y_m)
        if self._place is None or math.dist(here, self._place) > self._radius_m:
            self.n_moves += 1
            self._place, self._since_s = here, observation.time_s
        return observation.time_s - self._since_s > self._allowance_s
