"""Commands to the robot, and the dead-man's switch that they pass."""

import math
from dataclasses import dataclass

from serd_sim.scenario.settings import RobotSettings


@dataclass(frozen=True)
class Command:
    """Wanted forward speed and turning rate (positive turns left), as geometry_msgs/Twist."""

    linear_mps: float
    angular_radps: float

    @property
    def is_finite(self) -> bool:
        """Whether both numbers can be driven."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)


STOP = Command(linear_mps=0.0, angular_radps=0.0)


class CommandGuard:
    """Passes the last command on until it is too old; a command that is not finite is a stop."""

    def __init__(self, timeout_s: float = 0.5) -> None:
        self.timeout_s = timeout_s
        self.n_rejected = 0
        self._command = STOP
        self._received_s: float | None = None

    def receive(self, command: Command, time_s: float) -> None:
        """Take a new command that arrived now."""
        if not command.is_finite:
            self.n_rejected += 1
            command = STOP
        self._command = command
        self._received_s = time_s

    def is_stale(self, time_s: float) -> bool:
        """Whether nothing has arrived within the timeout; also when the clock went backwards."""
        if self._received_s is None:
            return True
        age = time_s - self._received_s
        return age > self.timeout_s + 1e-9 or age < 0.0

    def current(self, time_s: float) -> Command:
        """The command to drive now."""
        return STOP if self.is_stale(time_s) else self._command


def limited_velocity(
    command: Command, speed_mps: float, yaw_rate_radps: float, robot: RobotSettings, step_s: float
) -> tuple[float, float]:
    """(v, w) after one step towards the command, within the robot's speeds and accelerations."""
    wanted_v = min(max(command.linear_mps, robot.min_vel_x_mps), robot.max_vel_x_mps)
    wanted_w = min(
        max(command.angular_radps, -robot.max_vel_theta_radps), robot.max_vel_theta_radps
    )
    speeds_up = robot.acc_lim_x_mps2 * step_s
    brakes = (wanted_v - speed_mps) * speed_mps < 0.0
    v = _towards(speed_mps, wanted_v, robot.decel_lim_x_mps2 * step_s if brakes else speeds_up)
    if v * speed_mps < 0.0:  # beyond 0 it accelerates
        v = min(max(v, -speeds_up), speeds_up)
    return v, _towards(yaw_rate_radps, wanted_w, robot.acc_lim_theta_radps2 * step_s)


def chord_velocity(
    yaw_rad: float, speed_mps: float, yaw_rate_radps: float, step_s: float
) -> tuple[float, float]:
    """(vx, vy) whose straight line over the step ends where the arc of constant (v, w) ends."""
    half_turn = 0.5 * yaw_rate_radps * step_s
    chord = speed_mps * (math.sin(half_turn) / half_turn if abs(half_turn) > 1e-9 else 1.0)
    return chord * math.cos(yaw_rad + half_turn), chord * math.sin(yaw_rad + half_turn)


def _towards(value: float, wanted: float, largest_change: float) -> float:
    return value + min(max(wanted - value, -largest_change), largest_change)
