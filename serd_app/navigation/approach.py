"""The last metre: from the goal cell, in which a drive arrives, to the pose of the goal.

A cell is as exact as the policy is. Whoever sends a goal as Nav2 takes them gave a place and a
heading; the robot drives to the place, then it turns there.
"""

import math
from dataclasses import dataclass

from serd_app.navigation.settings import ApproachSettings
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

#: The approach is given up where the robot is no nearer for so long (s).
_PATIENCE_S = 15.0
_NEARER_M, _NEARER_RAD = 0.02, 0.05
#: Whoever drives the robot has ended its way where it is no faster.
_STANDING_MPS = 0.1


@dataclass(frozen=True)
class GoalPose:
    """A goal in the map; heading_rad: None where any heading will do."""

    x_m: float
    y_m: float
    heading_rad: float | None = None


class FinalApproach:
    """Drives to a goal pose within its cell. failed: why it was given up, empty until then."""

    def __init__(self, goal: GoalPose, settings: ApproachSettings) -> None:
        self.failed = ""
        self._goal, self._settings = goal, settings
        self._is_there = False
        self._nearest = math.inf
        self._since_s: float | None = None

    def step(self, observation: Observation) -> tuple[Waypoint, float] | None:
        """Where to drive and with which heading; the robot's own place to turn there, None at the
        end."""
        away_m = math.hypot(self._goal.x_m - observation.x_m, self._goal.y_m - observation.y_m)
        heading_rad = self._goal.heading_rad
        if heading_rad is None:
            heading_rad = observation.yaw_rad
        error_rad = abs(math.remainder(heading_rad - observation.yaw_rad, math.tau))
        stands = abs(observation.speed_mps) <= _STANDING_MPS
        if not self._is_there and stands and away_m <= self._settings.xy_goal_tolerance:
            self._is_there, self._nearest = True, math.inf
        if self._is_there and error_rad <= self._settings.yaw_goal_tolerance:
            return None
        left, least = (error_rad, _NEARER_RAD) if self._is_there else (away_m, _NEARER_M)
        if left < self._nearest - least or self._since_s is None:
            self._nearest, self._since_s = left, observation.time_s
        elif observation.time_s - self._since_s > _PATIENCE_S:
            what = f"{error_rad:.2f} rad" if self._is_there else f"{away_m:.2f} m"
            self.failed = f"in the goal cell, {what} from the goal"
            return None
        if self._is_there:
            return Waypoint(observation.x_m, observation.y_m), heading_rad
        return Waypoint(self._goal.x_m, self._goal.y_m), heading_rad
