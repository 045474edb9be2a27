"""The robot's motion: a unicycle with limits on speed and acceleration."""

import math

from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import Command


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
