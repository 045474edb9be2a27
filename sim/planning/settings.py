"""Parameters of the local planners as Nav2 users know them: metres, seconds and radians.

They stand in a scenario under `local_planner` and are the parameters of the node local_planner.
"""

from pydantic import Field

from sim.planning.dwa_settings import DwaSettings
from sim.planning.mppi_settings import MppiSettings
from sim.planning.recovery_settings import RecoverySettings
from sim.scenario.settings import RobotSettings
from storage.yaml_config import StrictModel

_DWA, _MPPI, _RECOVERY = DwaSettings(), MppiSettings(), RecoverySettings()
#: Parameter of the planner -> what it is of the robot.
_LIMITS = {
    "max_vel_x": "max_vel_x_mps",
    "min_vel_x": "min_vel_x_mps",
    "max_vel_theta": "max_vel_theta_radps",
    "acc_lim_x": "acc_lim_x_mps2",
    "acc_lim_theta": "acc_lim_theta_radps2",
}


class PlannerSettings(StrictModel):
    """The first five limit what is commanded; those of the robot where they are None."""

    max_vel_x: float | None = Field(default=None, description="fastest, m/s", gt=0)
    min_vel_x: float | None = Field(
        default=None, description="fastest backwards, m/s, not above 0", le=0
    )
    max_vel_theta: float | None = Field(default=None, description="fastest turn, rad/s", gt=0)
    acc_lim_x: float | None = Field(
        default=None, description="acceleration and braking, m/s2", gt=0
    )
    acc_lim_theta: float | None = Field(
        default=None, description="acceleration of turns, rad/s2", gt=0
    )
    controller_frequency: float | None = Field(
        default=None,
        description="commands per second, Hz: must be 1 / control_period_s",
        gt=0,
    )
    xy_goal_tolerance: float = Field(
        default=_DWA.xy_goal_tolerance_m,
        description="nearer than this to its waypoint the robot stands, m",
        gt=0,
    )

    sim_time: float = Field(
        default=_DWA.sim_time_s, description="dwa: how far ahead it looks, s", gt=0, le=20
    )
    time_granularity: float = Field(
        default=_DWA.time_granularity_s, description="dwa: step of that, s", ge=0.01, le=1.0
    )
    vx_samples: int = Field(default=_DWA.vx_samples, description="dwa: speeds tried", ge=3, le=200)
    vtheta_samples: int = Field(
        default=_DWA.vtheta_samples, description="dwa: turns tried", ge=3, le=200
    )

    batch_size: int = Field(
        default=_MPPI.batch_size, description="mppi: plans tried", ge=2, le=20000
    )
    time_steps: int = Field(
        default=_MPPI.time_steps, description="mppi: steps of a plan", ge=2, le=200
    )
    model_dt: float = Field(
        default=_MPPI.model_dt_s, description="mppi: one step, s", ge=0.01, le=1.0
    )
    temperature: float = Field(
        default=_MPPI.temperature,
        description="mppi: the lower, the more the best plan counts",
        gt=0,
    )
    vx_std: float = Field(
        default=_MPPI.vx_std_mps2,
        description="mppi: deviation of the accelerations tried, m/s2",
        gt=0,
    )
    wz_std: float = Field(
        default=_MPPI.wz_std_radps2, description="mppi: deviation of those of turns, rad/s2", gt=0
    )

    required_movement_radius: float = Field(
        default=_RECOVERY.required_movement_radius_m,
        description="who moves less than this is stuck, m",
        gt=0,
    )
    movement_time_allowance: float = Field(
        default=_RECOVERY.movement_time_allowance_s, description="in so much time, s", gt=0
    )
    failure_tolerance: float = Field(
        default=_RECOVERY.failure_tolerance_s, description="no way may be free so long, s", ge=0
    )
    number_of_retries: int = Field(
        default=_RECOVERY.number_of_retries,
        description="recoveries before FAILED_TO_MAKE_PROGRESS is told",
        ge=0,
    )
    backup_dist: float = Field(
        default=_RECOVERY.backup_dist_m, description="recovery: way back, m", gt=0
    )
    backup_speed: float = Field(
        default=_RECOVERY.backup_speed_mps, description="recovery: speed back, m/s", gt=0
    )
    spin_dist: float = Field(
        default=_RECOVERY.spin_dist_rad, description="recovery: turn on the spot, rad", gt=0
    )
    max_rotational_vel: float = Field(
        default=_RECOVERY.max_rotational_vel_radps,
        description="recovery: speed of that turn, rad/s",
        gt=0,
    )
    wait_duration: float = Field(
        default=_RECOVERY.wait_duration_s, description="recovery: wait, s", gt=0
    )

    @property
    def dwa(self) -> DwaSettings:
        """What of it concerns the dynamic window planner."""
        return DwaSettings(
            xy_goal_tolerance_m=self.xy_goal_tolerance,
            sim_time_s=self.sim_time,
            time_granularity_s=self.time_granularity,
            vx_samples=self.vx_samples,
            vtheta_samples=self.vtheta_samples,
        )

    @property
    def mppi(self) -> MppiSettings:
        """What of it concerns the path-integral planner."""
        return MppiSettings(
            xy_goal_tolerance_m=self.xy_goal_tolerance,
            batch_size=self.batch_size,
            time_steps=self.time_steps,
            model_dt_s=self.model_dt,
            temperature=self.temperature,
            vx_std_mps2=self.vx_std,
            wz_std_radps2=self.wz_std,
        )

    @property
    def recovery(self) -> RecoverySettings:
        """What of it concerns recoveries; who stands at a waypoint is never stuck."""
        return RecoverySettings(
            xy_goal_tolerance_m=max(_RECOVERY.xy_goal_tolerance_m, self.xy_goal_tolerance),
            required_movement_radius_m=self.required_movement_radius,
            movement_time_allowance_s=self.movement_time_allowance,
            failure_tolerance_s=self.failure_tolerance,
            number_of_retries=self.number_of_retries,
            backup_dist_m=self.backup_dist,
            backup_speed_mps=self.backup_speed,
            spin_dist_rad=self.spin_dist,
            max_rotational_vel_radps=self.max_rotational_vel,
            wait_duration_s=self.wait_duration,
        )

    def limited(self, robot: RobotSettings) -> RobotSettings:
        """The robot as the planners may drive it."""
        return robot.model_copy(
            update={
                of_robot: getattr(self, name)
                for name, of_robot in _LIMITS.items()
                if getattr(self, name) is not None
            }
        )

    def complete(self, robot: RobotSettings, control_period_s: float) -> "PlannerSettings":
        """The same with every value said that follows from the robot or the control period."""
        limited = self.limited(robot)
        values = {name: getattr(limited, of_robot) for name, of_robot in _LIMITS.items()}
        values["controller_frequency"] = 1.0 / control_period_s
        return self.model_copy(update=values)

    def require_within(self, robot: RobotSettings, control_period_s: float) -> None:
        """ValueError where the robot cannot do what the planners may ask, or not so often."""
        for name, of_robot in _LIMITS.items():
            value, limit = getattr(self, name), getattr(robot, of_robot)
            if value is not None and abs(value) > abs(limit):
                side = "at least" if limit <= 0 else "at most"
                raise ValueError(
                    f"local_planner.{name} must be {side} robot.{of_robot} ({limit:g})"
                    f", got {value:g}; leave it out for as much as the robot can"
                )
        wanted_hz, given_hz = 1.0 / control_period_s, self.controller_frequency
        if given_hz is not None and abs(given_hz - wanted_hz) > 1e-6 * wanted_hz:
            raise ValueError(
                f"local_planner.controller_frequency must be 1 / control_period_s ({wanted_hz:g} "
                f"Hz), got {given_hz:g}; leave it out or set control_period_s to {1 / given_hz:g}"
            )
