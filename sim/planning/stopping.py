"""How soon the robot can stand, which is how far ahead a planner has to look."""

from sim.errors import SimError
from sim.scenario.settings import RobotSettings

#: Time (s) that passes before the robot brakes.
REACTION_S = 0.3


def require_foresight(what: str, horizon_s: float, robot: RobotSettings) -> None:
    """SimError when a planner looks less far ahead than the robot takes to stop."""
    stopping_s = robot.max_vel_x_mps / robot.acc_lim_x_mps2 + REACTION_S
    if horizon_s < stopping_s:
        raise SimError(
            f"{what} must be at least {stopping_s:.3g} s, in which the robot stops from its fastest"
            f" ({robot.max_vel_x_mps:g} m/s at {robot.acc_lim_x_mps2:g} m/s2), got {horizon_s:g} s"
            "; raise it or lower local_planner.max_vel_x"
        )
