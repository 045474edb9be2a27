"""Recovery for a local planner that gets nowhere: back off, turn, wait, and try again.

Wraps any planner. How it fares is told in Nav2's words: NO_VALID_CONTROL while every way is
blocked, PATIENCE_EXCEEDED when that lasts too long, FAILED_TO_MAKE_PROGRESS when recoveries have
not helped either. The robot keeps trying all the same.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.crowd.social_force import model_named
from sim.geometry.occupancy import wall_distance_raster
from sim.planning.gentle_commands import GentleCommands
from sim.planning.local_planner import LocalPlanner
from sim.planning.planner_status import PlannerStatus
from sim.planning.progress_checker import ProgressChecker, ProgressState
from sim.planning.recovery_settings import RecoverySettings
from sim.scenario.scenario import Scenario
from sim.scenario.settings import RobotSettings
from sim.world.command import STOP, Command
from sim.world.observation import Observation
from sim.world.waypoint import Waypoint


@dataclass(frozen=True)
class Behaviour:
    """One command for some time."""

    command: Command
    duration_s: float


@dataclass(frozen=True, eq=False)
class RecoveryState:
    """What a snapshot keeps of the planner, its progress and the recoveries tried."""

    planner: Any
    progress: ProgressState
    status: PlannerStatus
    n_recoveries: int
    next_behaviour: int
    running: Behaviour | None
    until_s: float
    tries: int
    moves_before: int
    blocked_since_s: float | None


def behaviours_of(settings: RecoverySettings, limits: RobotSettings) -> tuple[Behaviour, ...]:
    """What is tried in turn, no faster than the limits; who may not drive back does not."""
    back_mps = min(settings.backup_speed_mps, -limits.min_vel_x_mps)
    spin_radps = min(settings.max_rotational_vel_radps, limits.max_vel_theta_radps)
    spin = Behaviour(Command(0.0, spin_radps), settings.spin_dist_rad / spin_radps)
    wait = Behaviour(STOP, settings.wait_duration_s)
    if back_mps <= 0.0:
        return spin, wait
    return Behaviour(Command(-back_mps, 0.0), settings.backup_dist_m / back_mps), spin, wait


class RecoveringPlanner:
    """A planner that does not stay stuck; `status` tells how it fares."""

    _running: Behaviour | None
    _blocked_since_s: float | None

    def __init__(
        self, planner: LocalPlanner, scenario: Scenario, settings: RecoverySettings | None = None
    ) -> None:
        parameters = scenario.local_planner
        self.settings = settings if settings is not None else parameters.recovery
        self.planner = planner
        self.n_recoveries = 0
        self._robot_radius_m = scenario.robot.radius_m
        self._gentle = GentleCommands(scenario)
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._walls = wall_distance_raster(scenario)
        self._progress = ProgressChecker(
            self.settings.required_movement_radius_m, self.settings.movement_time_allowance_s
        )
        self._behaviours = behaviours_of(self.settings, parameters.limited(scenario.robot))
        self.reset()

    @property
    def is_blocked(self) -> bool:
        """Whether the planner found no way to move when it was asked last."""
        return self.planner.is_blocked

    def reset(self) -> None:
        """Forget the past, at the start of an episode."""
        self.planner.reset()
        self._begin_anew()

    def snapshot(self) -> RecoveryState:
        """Copy of all that changes."""
        return RecoveryState(
            planner=self.planner.snapshot(),
            progress=self._progress.snapshot(),
            status=self.status,
            n_recoveries=self.n_recoveries,
            next_behaviour=self._next_behaviour,
            running=self._running,
            until_s=self._until_s,
            tries=self._tries,
            moves_before=self._moves_before,
            blocked_since_s=self._blocked_since_s,
        )

    def restore(self, state: RecoveryState) -> None:
        """Go back to a snapshot."""
        self.planner.restore(state.planner)
        self._progress.restore(state.progress)
        self.status, self.n_recoveries = state.status, state.n_recoveries
        self._next_behaviour, self._running = state.next_behaviour, state.running
        self._until_s, self._tries = state.until_s, state.tries
        self._moves_before, self._blocked_since_s = state.moves_before, state.blocked_since_s

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The planner's command, or that of the recovery that runs."""
        if not observation.tells_place:
            self.status = PlannerStatus.NO_VALID_CONTROL
            return STOP
        return self._gentle.gentle(observation, self._wanted(observation, waypoint))

    def _wanted(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        command = self.planner.step(observation, waypoint)
        if waypoint is None or self._is_at(observation, waypoint):
            self._begin_anew()
            return command
        recovery = self._running_command(observation)
        if recovery is None and self._progress.is_stuck(observation):
            recovery = self._start_recovery(observation)
        self._update_status(observation)
        return command if recovery is None else recovery

    def _is_at(self, observation: Observation, waypoint: Waypoint) -> bool:
        """Whether the robot may stand where it is: it has come to its waypoint."""
        away_m = math.hypot(waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m)
        return away_m < self.settings.xy_goal_tolerance_m

    def _begin_anew(self) -> None:
        self.status = PlannerStatus.NONE
        self._progress.reset()
        self._next_behaviour = 0
        self._running = None
        self._until_s = 0.0
        self._tries = 0
        self._moves_before = self._progress.n_moves
        self._blocked_since_s = None

    def _running_command(self, observation: Observation) -> Command | None:
        if self._running is None:
            return None
        reversing = self._running.command.linear_mps < 0
        blocked = reversing and not self._is_free_behind(observation)
        if blocked or observation.time_s >= self._until_s:
            self._running = None
            self._progress.allow_more_time(observation)
            return None
        return self._running.command

    def _start_recovery(self, observation: Observation) -> Command | None:
        if self._progress.n_moves != self._moves_before:
            self._moves_before, self._tries = self._progress.n_moves, 0
        self._tries += 1
        self.n_recoveries += 1
        self._running = self._behaviours[self._next_behaviour]
        self._next_behaviour = (self._next_behaviour + 1) % len(self._behaviours)
        self._until_s = observation.time_s + self._running.duration_s
        return self._running_command(observation)

    def _is_free_behind(self, observation: Observation) -> bool:
        """Whether neither wall nor person is close behind the robot."""
        reach_m = self.settings.free_space_behind_m
        x_m = np.array([observation.x_m - reach_m * math.cos(observation.yaw_rad)])
        y_m = np.array([observation.y_m - reach_m * math.sin(observation.yaw_rad)])
        away = observation.people_position_m - np.array([x_m[0], y_m[0]])
        people_gap = np.hypot(away[:, 0], away[:, 1]) - self._robot_radius_m - self._person_radius_m
        wall_gap = self._walls.at(x_m, y_m)[0] - self._robot_radius_m
        return bool(wall_gap > 0.0 and (people_gap > 0.0).all())

    def _update_status(self, observation: Observation) -> None:
        if not self.planner.is_blocked:
            self._blocked_since_s = None
        elif self._blocked_since_s is None:
            self._blocked_since_s = observation.time_s
        if self._tries > self.settings.number_of_retries:
            self.status = PlannerStatus.FAILED_TO_MAKE_PROGRESS
        elif self._blocked_since_s is None:
            self.status = PlannerStatus.NONE
        elif observation.time_s - self._blocked_since_s > self.settings.failure_tolerance_s:
            self.status = PlannerStatus.PATIENCE_EXCEEDED
        else:
            self.status = PlannerStatus.NO_VALID_CONTROL
