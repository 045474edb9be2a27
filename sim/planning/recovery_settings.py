"""Settings of the progress check and the recoveries, with the names Nav2 users know."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RecoverySettings:
    """xy_goal_tolerance_m: nearer than this to its waypoint, a robot that stands is not stuck.

    failure_tolerance_s: how long no way may be free before PATIENCE_EXCEEDED is told.
    number_of_retries: how many recoveries are tried before FAILED_TO_MAKE_PROGRESS is told.
    """

    xy_goal_tolerance_m: float = 0.25
    required_movement_radius_m: float = 0.5
    movement_time_allowance_s: float = 10.0
    failure_tolerance_s: float = 5.0
    number_of_retries: int = 3
    backup_dist_m: float = 0.225
    backup_speed_mps: float = 0.15
    spin_dist_rad: float = 1.5
    max_rotational_vel_radps: float = 1.5
    wait_duration_s: float = 2.0
    free_space_behind_m: float = 0.35
