"""Metrics of an episode: distances to people and smoothness of the commands.

Hall's zones (The Hidden Dimension, 1966) end 0.45 m (intimate) and 1.2 m (personal) from a person's
centre; between bodies of 0.25 m radius, that leaves gaps of 0.2 m and 0.95 m.
"""

from dataclasses import dataclass, field

import numpy as np

from serd_core.grid.grid import Action
from sim.crowd.social_force import model_named
from sim.scenario.scenario import Scenario
from sim.world.command import Command
from sim.world.observation import Observation

INTIMATE_M = 0.2
PERSONAL_M = 0.95


@dataclass(frozen=True)
class EpisodeMetrics:
    """Shares of the episode's time, mean changes of the command per second."""

    intimate_share: float
    personal_share: float
    mean_speed_mps: float
    mean_abs_acceleration_mps2: float
    mean_abs_turn_acceleration_radps2: float


@dataclass
class MetricsObserver:
    """Pass `see` to run_episode as its observer, then read `metrics`."""

    scenario: Scenario
    _gaps_m: list[float] = field(default_factory=list)
    _commands: list[tuple[float, float]] = field(default_factory=list)
    _speeds_mps: list[float] = field(default_factory=list)

    def see(self, observation: Observation, command: Command, _action: Action) -> None:
        """Take one control tick."""
        reach = self.scenario.robot.radius_m + self._person_radius_m
        away = observation.people_position_m - observation.pose[:2]
        distance = np.sqrt(away[:, 0] ** 2 + away[:, 1] ** 2)
        self._gaps_m.append(float(distance.min(initial=np.inf)) - reach)
        self._commands.append((command.linear_mps, command.angular_radps))
        self._speeds_mps.append(abs(observation.speed_mps))

    @property
    def _person_radius_m(self) -> float:
        return model_named(self.scenario.pedestrians.model).body_radius_m

    @property
    def metrics(self) -> EpisodeMetrics:
        """Of all ticks seen so far."""
        gaps, commands = np.array(self._gaps_m), np.array(self._commands).reshape(-1, 2)
        change = np.abs(np.diff(commands, axis=0)) / self.scenario.control_period_s
        smooth = change.mean(axis=0) if len(change) else np.zeros(2)
        return EpisodeMetrics(
            intimate_share=float((gaps < INTIMATE_M).mean()) if len(gaps) else 0.0,
            personal_share=float((gaps < PERSONAL_M).mean()) if len(gaps) else 0.0,
            mean_speed_mps=float(np.mean(self._speeds_mps)) if self._speeds_mps else 0.0,
            mean_abs_acceleration_mps2=float(smooth[0]),
            mean_abs_turn_acceleration_radps2=float(smooth[1]),
        )
