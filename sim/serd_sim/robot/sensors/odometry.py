"""Where the robot believes it is from its wheels alone: their motion plus drift.

Each control period the motion in the robot's frame, (d, dyaw), is that of the wheels, which slip,
or the true one where the robot has no wheels. It is reported as

    d (1 + s_d) + n_d sqrt(|d|),   dyaw (1 + s_w) + n_w sqrt(|d|)

with scale errors s drawn once per episode and fresh normal n. Deviations of 0 add nothing.
"""

import math

import numpy as np

from serd_sim.scenario.settings import OdometrySettings
from serd_sim.world.observation import Pose


class Odometry:
    """Dead reckoning from the start of an episode on, beginning at the true pose."""

    def __init__(self, settings: OdometrySettings, start: Pose, rng: np.random.Generator) -> None:
        self.pose = start
        self._settings, self._rng = settings, rng
        self._last_truth = start
        scale_distance, scale_turn = rng.standard_normal(2)
        self._distance_scale = 1.0 + settings.distance_scale_deviation * scale_distance
        self._turn_scale = 1.0 + settings.turn_scale_deviation * scale_turn

    def follow(self, truth: Pose) -> None:
        """Take the true pose of the next control period, of a robot without wheels."""
        before, self._last_truth = self._last_truth, truth
        if not self._settings.drifts:
            self.pose = truth
            return
        turned = math.remainder(truth[2] - before[2], math.tau)
        heading = before[2] + 0.5 * turned
        moved_x, moved_y = truth[0] - before[0], truth[1] - before[1]
        self.add(moved_x * math.cos(heading) + moved_y * math.sin(heading), turned)

    def add(self, distance: float, turned: float) -> None:
        """Take the motion (m, rad) of the wheels in the next control period."""
        noise = math.sqrt(abs(distance)) * self._rng.standard_normal(2)
        distance = distance * self._distance_scale + self._settings.distance_noise_m * noise[0]
        turned = turned * self._turn_scale + self._settings.turn_noise_rad * noise[1]
        x_m, y_m, yaw_rad = self.pose
        middle = yaw_rad + 0.5 * turned
        self.pose = (
            x_m + distance * math.cos(middle),
            y_m + distance * math.sin(middle),
            math.remainder(yaw_rad + turned, math.tau),
        )
