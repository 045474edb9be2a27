"""Parameters of the local planners, their progress check and recoveries, under Nav2's names.

They stand in a scenario under `local_planner` and are the parameters of the node local_planner.
"""

from serd_files.settings import setting
from serd_files.yaml_config import StrictModel
from serd_sim.scenario.settings import RobotSettings

#: Limit of the planner -> limit of the robot.
_LIMITS = {
    "max_vel_x": "max_vel_x_mps",
    "min_vel_x": "min_vel_x_mps",
    "max_vel_theta": "max_vel_theta_radps",
    "acc_lim_x": "acc_lim_x_mps2",
    "acc_lim_theta": "acc_lim_theta_radps2",
}


class PlannerSettings(StrictModel):
    """Parameters in SI units; each limit defaults to that of the robot."""

    max_vel_x: float | None = setting(
        None, "largest commanded speed forward", live="any", unit="m/s", gt=0
    )
    min_vel_x: float | None = setting(
        None, "largest commanded speed backward; 0: never drive backward", unit="m/s", le=0
    )
    max_vel_theta: float | None = setting(
        None, "largest commanded turning rate", live="any", unit="rad/s", gt=0
    )
    acc_lim_x: float | None = setting(
        None, "largest acceleration and deceleration", unit="m/s²", gt=0
    )
    acc_lim_theta: float | None = setting(
        None, "largest acceleration of turns", unit="rad/s²", gt=0
    )
    controller_frequency: float | None = setting(
        None, "commands per second; must be 1 / control_period_s", unit="Hz", gt=0
    )
    xy_goal_tolerance: float = setting(
        0.1, "stand still nearer than this to the waypoint", live="any", unit="m", gt=0
    )

    sim_time: float = setting(1.4, "horizon of a rollout", unit="s", gt=0, le=20)
    time_granularity: float = setting(0.1, "step of a rollout", unit="s", ge=0.01, le=1.0)
    vx_samples: int = setting(9, "sampled speeds", ge=3, le=200)
    vtheta_samples: int = setting(21, "sampled turning rates", ge=3, le=200)

    required_movement_radius: float = setting(
        0.5, "a robot that moves less than this is stuck", live="any", unit="m", gt=0
    )
    movement_time_allowance: float = setting(
        10.0, "time within which it must move so far", live="any", unit="s", gt=0
    )
    failure_tolerance: float = setting(
        5.0, "status PATIENCE_EXCEEDED after being blocked for longer", live="any", unit="s", ge=0
    )
    number_of_retries: int = setting(
        3, "status FAILED_TO_MAKE_PROGRESS after more recoveries; recoveries go on", ge=0
    )
    backup_dist: float = setting(
        0.225, "first recovery: distance backward, when free", unit="m", gt=0
    )
    backup_speed: float = setting(0.15, "first recovery: speed backward", unit="m/s", gt=0)
    spin_dist: float = setting(1.5, "second recovery: angle of a turn in place", unit="rad", gt=0)
    max_rotational_vel: float = setting(1.5, "second recovery: turning rate", unit="rad/s", gt=0)
    wait_duration: float = setting(2.0, "third recovery: waiting time", unit="s", gt=0)

    def limited(self, robot: RobotSettings) -> RobotSettings:
        """The robot as the planners may drive it; they brake as they accelerate."""
        given = {
            of_robot: getattr(self, name)
            for name, of_robot in _LIMITS.items()
            if getattr(self, name) is not None
        }
        braking_mps2 = given.get("acc_lim_x_mps2", robot.acc_lim_x_mps2)
        return robot.model_copy(update=given | {"decel_lim_x_mps2": braking_mps2})

    def complete(self, robot: RobotSettings, control_period_s: float) -> "PlannerSettings":
        """The same with every value that defaults to the robot's or the control period's."""
        limited = self.limited(robot)
        values = {name: getattr(limited, of_robot) for name, of_robot in _LIMITS.items()}
        values["controller_frequency"] = 1.0 / control_period_s
        return self.model_copy(update=values)

    def require_within(self, robot: RobotSettings, control_period_s: float) -> None:
        """ValueError where a limit exceeds the robot's or the frequency is not the scenario's."""
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
