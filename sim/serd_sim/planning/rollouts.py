"""Commands the robot can reach soon, their rollouts under its limits, and how soon it can stop.

Index order [i, j, t]: speed i, turning rate j, time t. A rollout ramps to its speed and keeps it;
it ramps to its turning rate, keeps it for the turn time and then goes straight on. How soon the
robot can stop is how far ahead a planner has to look.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.errors import SimError
from serd_sim.scenario.settings import RobotSettings

#: Time (s) that passes before the robot brakes.
REACTION_S = 0.3
#: Share of the deceleration that planners count on for stopping at the waypoint.
BRAKING_SHARE = 0.7


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


def require_foresight(name: str, horizon_s: float, robot: RobotSettings) -> None:
    """SimError when the horizon of a planner is shorter than the robot takes to stop."""
    stopping_s = robot.max_vel_x_mps / robot.acc_lim_x_mps2 + REACTION_S
    if horizon_s < stopping_s:
        raise SimError(
            f"{name} must be at least {stopping_s:.3g} s, in which the robot stops from its fastest"
            f" ({robot.max_vel_x_mps:g} m/s at {robot.acc_lim_x_mps2:g} m/s2), got {horizon_s:g} s"
            "; raise it or lower local_planner.max_vel_x"
        )


def speed_to_stop_within(distance_m: float, robot: RobotSettings) -> float:
    """Largest speed (m/s) from which the robot stops within a distance: v^2 = 2 a d."""
    return float(np.sqrt(2.0 * BRAKING_SHARE * robot.acc_lim_x_mps2 * distance_m))


def before_stop(
    speed_mps: FloatArray,
    robot: RobotSettings,
    time_s: FloatArray,
    *,
    slowest_mps: float,
    reaction_s: float = REACTION_S,
) -> BoolArray:
    """(N, n) which of the (T,) times come before a robot at each of (N,) speeds has stopped.

    None do at speeds of up to slowest_mps. The columns end with the last one that holds a time.
    """
    fast_mps = np.abs(speed_mps)
    stopping_s = fast_mps / robot.acc_lim_x_mps2 + reaction_s
    stopping_s[fast_mps <= slowest_mps] = -1.0
    n_columns = time_s.searchsorted(stopping_s.max(initial=-1.0), side="right")
    before: BoolArray = time_s[:n_columns] <= stopping_s[:, None]
    return before
