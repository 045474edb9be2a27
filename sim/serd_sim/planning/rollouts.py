"""Commands the robot can reach soon, and their rollouts under its acceleration limits.

Index order [i, j, t]: speed i, turning rate j, time t. A rollout ramps to its speed and keeps it;
it ramps to its turning rate, keeps it for the turn time and then goes straight on.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_sim.scenario.settings import RobotSettings


def reachable_window(
    robot: RobotSettings, speed_mps: float, yaw_rate_radps: float, window_s: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Slowest and fastest speed, rightmost and leftmost turn that the robot can reach soon.

    The dynamic window (Fox, Burgard & Thrun 1997): limits of the robot and its accelerations.
    """
    change_v, change_w = robot.acc_lim_x_mps2 * window_s, robot.acc_lim_theta_radps2 * window_s
    most_w = robot.max_vel_theta_radps
    return (
        (
            max(robot.min_vel_x_mps, speed_mps - change_v),
            min(robot.max_vel_x_mps, speed_mps + change_v),
        ),
        (max(-most_w, yaw_rate_radps - change_w), min(most_w, yaw_rate_radps + change_w)),
    )


@dataclass(frozen=True, eq=False)
class Rollouts:
    """x_m, y_m: (V, W, T) positions; speed_mps: (V, T); yaw_rad: (W, T)."""

    x_m: FloatArray
    y_m: FloatArray
    speed_mps: FloatArray
    yaw_rad: FloatArray


def ramp(start: float, wanted: FloatArray, limit: float, time_s: FloatArray) -> FloatArray:
    """(n, T) values that go from `start` to each wanted one at the limited rate."""
    reach = limit * time_s
    change: FloatArray = np.minimum(np.maximum((wanted - start)[:, None], -reach), reach)
    return start + change


def roll_out(
    pose: tuple[float, float, float],
    speeds: tuple[float, FloatArray],
    turns: tuple[float, FloatArray],
    robot: RobotSettings,
    time_s: FloatArray,
    turn_time_s: float,
    start_s: float = 0.0,
) -> Rollouts:
    """Rollouts from a pose; `speeds` and `turns` are the present value and the sampled ones.

    start_s: how long the present speed is kept before the ramp to the sampled one.
    """
    step_s = time_s[0]
    middle_s = time_s - 0.5 * step_s
    speed = ramp(speeds[0], speeds[1], robot.acc_lim_x_mps2, np.maximum(middle_s - start_s, 0.0))
    turning = ramp(turns[0], turns[1], robot.acc_lim_theta_radps2, middle_s)
    turning = np.where(middle_s > turn_time_s, 0.0, turning)
    yaw = pose[2] + step_s * turning.cumsum(axis=1)
    middle_yaw = yaw - 0.5 * step_s * turning
    x_m = _positions(pose[0], speed, np.cos(middle_yaw), step_s)
    y_m = _positions(pose[1], speed, np.sin(middle_yaw), step_s)
    return Rollouts(x_m=x_m, y_m=y_m, speed_mps=speed, yaw_rad=yaw)


def _positions(
    start_m: float, speed_mps: FloatArray, direction: FloatArray, step_s: float
) -> FloatArray:
    """(V, W, T) one coordinate; direction: (W, T) that of unit vectors along the motion."""
    way: FloatArray = (speed_mps[:, None, :] * direction).cumsum(axis=2)
    way *= step_s
    way += start_m
    return way
