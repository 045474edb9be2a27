"""Settings of the dynamic window planner, with the names Nav2 users know and their units."""

from dataclasses import dataclass, field

from sim.errors import SimError
from sim.planning.cost_settings import CostSettings
from sim.scenario.settings import RobotSettings


@dataclass(frozen=True)
class DwaSettings:
    """sim_time_s: horizon; vx_samples, vtheta_samples: size of the window of window_s.

    turn_time_s: how long a sampled turn lasts before the rollout goes straight on.
    leaving_turn_s: how long a blocked robot may turn on the spot before it drives on.
    braking_share: part of the deceleration counted on for stopping at the waypoint.
    """

    xy_goal_tolerance_m: float = 0.1
    sim_time_s: float = 1.4
    time_granularity_s: float = 0.1
    vx_samples: int = 9
    vtheta_samples: int = 21
    window_s: float = 0.3
    turn_time_s: float = 0.4
    leaving_turn_s: float = 0.6
    braking_share: float = 0.7
    turning_weight: float = 0.01
    costs: CostSettings = field(default_factory=CostSettings)

    def __post_init__(self) -> None:
        for name in ("sim_time_s", "time_granularity_s", "window_s", "xy_goal_tolerance_m"):
            if not getattr(self, name) > 0:
                raise SimError(f"{name} must be above 0, got {getattr(self, name)}; raise it")
        for name in ("vx_samples", "vtheta_samples"):
            if getattr(self, name) < 3:
                raise SimError(f"{name} must be at least 3, got {getattr(self, name)}; sample more")

    @property
    def n_steps(self) -> int:
        """Points of one rollout."""
        return max(2, round(self.sim_time_s / self.time_granularity_s))


@dataclass(frozen=True)
class Window:
    """Speeds the robot can reach soon, low to high."""

    slowest_mps: float
    fastest_mps: float
    rightmost_radps: float
    leftmost_radps: float


def reachable_window(
    robot: RobotSettings, speed_mps: float, yaw_rate_radps: float, window_s: float
) -> Window:
    """The dynamic window (Fox, Burgard & Thrun 1997): limits of the robot and its accelerations."""
    change_v, change_w = robot.acc_lim_x_mps2 * window_s, robot.acc_lim_theta_radps2 * window_s
    return Window(
        slowest_mps=max(robot.min_vel_x_mps, speed_mps - change_v),
        fastest_mps=min(robot.max_vel_x_mps, speed_mps + change_v),
        rightmost_radps=max(-robot.max_vel_theta_radps, yaw_rate_radps - change_w),
        leftmost_radps=min(robot.max_vel_theta_radps, yaw_rate_radps + change_w),
    )
