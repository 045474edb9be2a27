"""Metrics of an episode: nearness to people, collisions to come, disturbance, smoothness, the way.

The set is that of Francis et al., Principles and Guidelines for Evaluating Social Robot Navigation
Algorithms (ACM THRI, 2025). Hall's zones (The Hidden Dimension, 1966) end 0.45 m (intimate) and
1.2 m (personal) from a person's centre; between bodies of 0.25 m radius, that leaves gaps of 0.2 m
and 0.95 m.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.grid.grid import Action
from serd_sim.crowd.social_force import model_named
from serd_sim.scenario.scenario import Scenario
from serd_sim.world.command import Command
from serd_sim.world.observation import Observation

INTIMATE_M = 0.2
PERSONAL_M = 0.95
#: A time to collision below this (s) counts.
COLLISION_AHEAD_S = 1.0
#: The robot stands below this speed (m/s).
STANDING_MPS = 0.05


@dataclass(frozen=True)
class EpisodeMetrics:
    """Shares of the episode's time; means over time, of absolute values.

    collision_ahead_share: a time to collision with a person below 1 s. path_irregularity_radpm:
    turning per metre of way (Guzzi et al., ICRA 2013, without the turns that the place asks for).
    mean_abs_jerk_mps3: of the measured speed.
    """

    intimate_share: float
    personal_share: float
    collision_ahead_share: float
    standing_share: float
    mean_speed_mps: float
    mean_abs_acceleration_mps2: float
    mean_abs_turn_acceleration_radps2: float
    mean_abs_jerk_mps3: float
    path_irregularity_radpm: float


class MetricsObserver:
    """Pass `see` to run_episode as its observer, then read `metrics`."""

    def __init__(self, scenario: Scenario) -> None:
        self._period_s = scenario.control_period_s
        person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._reach_m = scenario.robot.radius_m + person_radius_m
        #: Of each tick: gap, whether a collision is ahead, command, pose and speed.
        self._ticks: list[tuple[float, ...]] = []

    def see(self, observation: Observation, command: Command, _action: Action) -> None:
        """Take one control tick."""
        away = observation.people_position_m - observation.pose[:2]
        gaps_m = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2) - self._reach_m
        yaw_rad, speed_mps = observation.yaw_rad, observation.speed_mps
        velocity_mps = speed_mps * np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        closing_mps = observation.people_velocity_mps - velocity_mps
        times_s = time_to_collision_s(away, closing_mps, self._reach_m)
        is_ahead = times_s.min(initial=np.inf) < COLLISION_AHEAD_S
        nearness = float(gaps_m.min(initial=np.inf)), float(is_ahead)
        commanded = command.linear_mps, command.angular_radps
        self._ticks.append((*nearness, *commanded, *observation.pose, speed_mps))

    @property
    def metrics(self) -> EpisodeMetrics:
        """Of all ticks seen so far; 0 where there was nothing to average."""
        ticks, period_s = np.array(self._ticks).reshape(-1, 8), self._period_s
        gaps, ahead, _, _, x_m, y_m, yaw_rad, speed_mps = ticks.T
        acceleration, turn_acceleration = np.diff(ticks[:, 2:4], axis=0).T / period_s
        way_m = float(np.hypot(np.diff(x_m), np.diff(y_m)).sum())
        turned_rad = np.abs(np.diff(np.unwrap(yaw_rad))).sum()
        return EpisodeMetrics(
            intimate_share=_mean_abs(gaps < INTIMATE_M),
            personal_share=_mean_abs(gaps < PERSONAL_M),
            collision_ahead_share=_mean_abs(ahead),
            standing_share=_mean_abs(np.abs(speed_mps) < STANDING_MPS),
            mean_speed_mps=_mean_abs(speed_mps),
            mean_abs_acceleration_mps2=_mean_abs(acceleration),
            mean_abs_turn_acceleration_radps2=_mean_abs(turn_acceleration),
            mean_abs_jerk_mps3=_mean_abs(np.diff(speed_mps, 2) / period_s**2),
            path_irregularity_radpm=float(turned_rad / way_m) if way_m > 0.0 else 0.0,
        )


def time_to_collision_s(away_m: FloatArray, velocity_mps: FloatArray, reach_m: float) -> FloatArray:
    """(N,) time until discs touch that go on straight, 0 where they do, inf where they never do.

    away_m, velocity_mps: (N, 2) positions and velocities relative to the robot. reach_m: sum of the
    radii.
    """
    squared_speed = np.einsum("ij,ij->i", velocity_mps, velocity_mps)
    approach = -np.einsum("ij,ij->i", away_m, velocity_mps)
    beyond = np.einsum("ij,ij->i", away_m, away_m) - reach_m**2
    discriminant = approach**2 - squared_speed * beyond
    comes = (approach > 0.0) & (discriminant >= 0.0) & (beyond > 0.0)
    time_s = np.full(len(away_m), np.inf)
    # The stable form of (approach - sqrt(discriminant)) / squared speed.
    time_s[comes] = beyond[comes] / (approach[comes] + np.sqrt(discriminant[comes]))
    time_s[beyond <= 0.0] = 0.0
    return time_s


def _mean_abs(values: object) -> float:
    array = np.asarray(values, dtype=np.float64)
    return float(np.abs(array).mean()) if array.size else 0.0
