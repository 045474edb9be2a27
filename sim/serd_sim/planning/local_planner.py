"""The interface of local planners, and the recovery of one that makes no progress.

The robot drives backward, turns, waits, and tries again.

Wraps any planner. Its status has the names of Nav2's FollowPath: NO_VALID_CONTROL while every
motion is forbidden, PATIENCE_EXCEEDED when that lasts too long, FAILED_TO_MAKE_PROGRESS when
recoveries have not helped either. The robot keeps trying in every case.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np

from serd_sim.crowd.social_force import model_named
from serd_sim.planning.dwa import DwaPlanner
from serd_sim.planning.settings import PlannerSettings
from serd_sim.planning.sight import Sight
from serd_sim.safety.motion import motion_between
from serd_sim.scenario.occupancy import wall_distance_raster
from serd_sim.scenario.scenario import Scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import STOP, Command, limited_velocity
from serd_sim.world.observation import Observation
from serd_sim.world.waypoint import Waypoint

#: A robot that stands nearer than this (m), and than this share of a cell, to its waypoint is never
#: stuck.
_AT_WAYPOINT_M, _AT_WAYPOINT_CELLS = 0.25, 0.25
#: A robot that is to turn in place stands within this angle; rate (1/s) of a larger error.
_ALIGNED_RAD, _TURNS_PER_RAD = 0.1, 2.0
#: Where the space behind the robot is checked before and while it drives backward.
_FREE_SPACE_BEHIND_M = 0.35
#: A robot that has nowhere to drive for no longer than this (s) may still be stuck.
_LEFT_OUT_S = 2.0
#: A recovery may last as many times as long as at its own speed.
_ALLOWED, _ROUNDING = 4.0, 1e-9


class PlannerStatus(IntEnum):
    """NONE: no error; the others are the error codes of nav2_msgs/FollowPath."""

    NONE = 0
    PATIENCE_EXCEEDED = 104
    FAILED_TO_MAKE_PROGRESS = 105
    NO_VALID_CONTROL = 106


class LocalPlanner(Protocol):
    """Drives to waypoints around people; used by the node, batch runs and tests alike."""

    @property
    def is_blocked(self) -> bool:
        """Whether every motion was forbidden at the last step."""

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """Command for the next control period; without a waypoint, stand still."""


@dataclass(frozen=True)
class Behaviour:
    """A command, and how far it drives (m), or turns (rad), or how long (s) it waits."""

    command: Command
    extent: float

    def done(self, before: Observation, now: Observation) -> float:
        """How much of the extent the robot has done between two observations.

        Motion the other way counts as negative, so that noise of the pose cancels.
        """
        ahead_m, _, turned_rad = motion_between(before.pose, now.pose)
        if self.command.linear_mps:
            return math.copysign(ahead_m, ahead_m * self.command.linear_mps)
        if self.command.angular_radps:
            return math.copysign(turned_rad, turned_rad * self.command.angular_radps)
        return now.time_s - before.time_s

    @property
    def longest_s(self) -> float:
        """When it ends where the robot is slower than the command, as a guard may make it."""
        rate = max(abs(self.command.linear_mps), abs(self.command.angular_radps))
        return _ALLOWED * self.extent / rate if rate else self.extent


def behaviours_of(settings: PlannerSettings, limits: RobotSettings) -> tuple[Behaviour, ...]:
    """The recoveries in their order, within the limits; a robot that must not reverse turns."""
    back_mps = min(settings.backup_speed, -limits.min_vel_x_mps)
    spin_radps = min(settings.max_rotational_vel, limits.max_vel_theta_radps)
    spin = Behaviour(Command(0.0, spin_radps), settings.spin_dist)
    wait = Behaviour(STOP, settings.wait_duration)
    if back_mps <= 0.0:
        return spin, wait
    return Behaviour(Command(-back_mps, 0.0), settings.backup_dist), spin, wait


def make_planner(scenario: Scenario) -> "RecoveringPlanner":
    """The dynamic window planner with its recoveries, for the scenario's walls and robot."""
    return RecoveringPlanner(DwaPlanner(scenario), scenario)


class RecoveringPlanner:
    """A planner with recoveries; `status`: that of Nav2's FollowPath."""

    def __init__(self, planner: LocalPlanner, scenario: Scenario) -> None:
        self.planner = planner
        self.n_recoveries = 0
        self._wanted_s = 0.0
        self._settings = scenario.local_planner
        self._robot, self._period_s = scenario.robot, scenario.control_period_s
        self._limits = self._settings.limited(scenario.robot)
        self._at_waypoint_m = min(_AT_WAYPOINT_M, _AT_WAYPOINT_CELLS * scenario.cell_size_m)
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._walls = wall_distance_raster(scenario)
        self._sight = Sight(scenario)
        self._behaviours = behaviours_of(self._settings, self._limits)
        self.reset()

    @property
    def is_blocked(self) -> bool:
        """Whether every motion was forbidden at the last step."""
        return self.planner.is_blocked

    def reset(self) -> None:
        """Discard all state, at the start of an episode."""
        self.planner.reset()
        self._begin_anew()

    def step(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        """The command of the planner or of the running recovery; without a pose, stop."""
        if not observation.is_finite:
            self.status = PlannerStatus.NO_VALID_CONTROL
            return STOP
        return self._within_accelerations(observation, self._wanted(observation, waypoint))

    def turn(self, observation: Observation, heading_rad: float) -> Command:
        """The command that turns the robot in place to a heading; it stands once it has it."""
        error_rad = math.remainder(heading_rad - observation.yaw_rad, math.tau)
        if not observation.is_finite or abs(error_rad) < _ALIGNED_RAD:
            return STOP
        most_radps = min(self._settings.max_rotational_vel, self._limits.max_vel_theta_radps)
        turn_radps = max(-most_radps, min(most_radps, _TURNS_PER_RAD * error_rad))
        return self._within_accelerations(observation, Command(0.0, turn_radps))

    def _within_accelerations(self, observation: Observation, command: Command) -> Command:
        """The command as far as accelerations below those of the robot allow in one period."""
        robot, limits = self._robot, self._limits
        if (
            limits.acc_lim_x_mps2 >= robot.acc_lim_x_mps2
            and limits.acc_lim_theta_radps2 >= robot.acc_lim_theta_radps2
        ):
            return command
        speeds = observation.speed_mps, observation.yaw_rate_radps
        return Command(*limited_velocity(command, *speeds, limits, self._period_s))

    def _wanted(self, observation: Observation, waypoint: Waypoint | None) -> Command:
        aim = None if waypoint is None else self._sight.aim(observation, waypoint)
        command = self.planner.step(observation, aim)
        if waypoint is None:
            if observation.time_s - self._wanted_s > _LEFT_OUT_S:
                self._begin_anew()
            return command
        if self._is_at(observation, waypoint):
            self._begin_anew()
            return command
        self._wanted_s = observation.time_s
        recovery = self._running_command(observation)
        if recovery is None and self._is_stuck(observation):
            recovery = self._start_recovery(observation)
        self._update_status(observation)
        return command if recovery is None else recovery

    def _is_at(self, observation: Observation, waypoint: Waypoint) -> bool:
        """Whether the robot may stand still because it has reached its waypoint."""
        away_m = math.hypot(waypoint.x_m - observation.x_m, waypoint.y_m - observation.y_m)
        return away_m < max(self._at_waypoint_m, self._settings.xy_goal_tolerance)

    def _begin_anew(self) -> None:
        self.status = PlannerStatus.NONE
        self._place: tuple[float, float] | None = None
        self._since_s = self._until_s = self._done = 0.0
        self._next_behaviour = self._tries = 0
        self._running: Behaviour | None = None
        self._seen: Observation | None = None
        self._blocked_since_s: float | None = None

    def _is_stuck(self, observation: Observation) -> bool:
        """Whether the robot has not moved by the radius within the time allowance.

        The rule of Nav2's SimpleProgressChecker.
        """
        here, radius_m = (observation.x_m, observation.y_m), self._settings.required_movement_radius
        if self._place is None or math.dist(here, self._place) > radius_m:
            self._place, self._since_s, self._tries = here, observation.time_s, 0
        return observation.time_s - self._since_s > self._settings.movement_time_allowance

    def _running_command(self, observation: Observation) -> Command | None:
        running = self._running
        if running is None:
            return None
        self._done += running.done(self._seen or observation, observation)
        self._seen = observation
        blocked = running.command.linear_mps < 0 and not self._is_free_behind(observation)
        is_done = self._done >= running.extent - _ROUNDING
        if blocked or is_done or observation.time_s >= self._until_s:
            self._running, self._since_s = None, observation.time_s
            return None
        return running.command

    def _start_recovery(self, observation: Observation) -> Command | None:
        self._tries += 1
        self.n_recoveries += 1
        self._running = self._behaviours[self._next_behaviour]
        self._next_behaviour = (self._next_behaviour + 1) % len(self._behaviours)
        self._seen, self._done = observation, 0.0
        self._until_s = observation.time_s + self._running.longest_s
        return self._running_command(observation)

    def _is_free_behind(self, observation: Observation) -> bool:
        """Whether neither wall nor person is close behind the robot."""
        x_m = observation.x_m - _FREE_SPACE_BEHIND_M * math.cos(observation.yaw_rad)
        y_m = observation.y_m - _FREE_SPACE_BEHIND_M * math.sin(observation.yaw_rad)
        away = observation.people_position_m - np.array([x_m, y_m])
        radius_m = self._robot.outline.radius_m
        people_gap = np.hypot(away[:, 0], away[:, 1]) - radius_m - self._person_radius_m
        wall_gap = self._walls.at(np.array([x_m]), np.array([y_m]))[0] - radius_m
        return bool(wall_gap > 0.0 and (people_gap > 0.0).all())

    def _update_status(self, observation: Observation) -> None:
        if not self.planner.is_blocked:
            self._blocked_since_s = None
        elif self._blocked_since_s is None:
            self._blocked_since_s = observation.time_s
        if self._tries > self._settings.number_of_retries:
            self.status = PlannerStatus.FAILED_TO_MAKE_PROGRESS
        elif self._blocked_since_s is None:
            self.status = PlannerStatus.NONE
        elif observation.time_s - self._blocked_since_s > self._settings.failure_tolerance:
            self.status = PlannerStatus.PATIENCE_EXCEEDED
        else:
            self.status = PlannerStatus.NO_VALID_CONTROL
