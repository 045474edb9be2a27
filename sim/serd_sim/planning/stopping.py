"""How soon the robot can stop, which is how far ahead a planner has to look."""

import numpy as np

from serd_core.arrays import BoolArray, FloatArray
from serd_sim.errors import SimError
from serd_sim.scenario.settings import RobotSettings

#: Time (s) that passes before the robot brakes.
REACTION_S = 0.3
#: Share of the deceleration that planners count on for stopping at the waypoint.
BRAKING_SHARE = 0.7


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
