"""Settings of the path-integral planner."""

from dataclasses import dataclass

from sim.errors import SimError


@dataclass(frozen=True)
class MppiSettings:
    """batch_size rollouts of time_steps steps of model_dt_s; temperature of the weighting.

    vx_std_mps2, wz_std_radps2: deviations of the sampled accelerations. Names as in Nav2's MPPI.
    """

    controller_frequency_hz: float = 20.0
    xy_goal_tolerance_m: float = 0.1
    batch_size: int = 300
    time_steps: int = 14
    model_dt_s: float = 0.1
    temperature: float = 0.08
    vx_std_mps2: float = 2.0
    wz_std_radps2: float = 6.0
    noise_hold_steps: int = 2
    seed: int = 1
    wall_margin_m: float = 0.03
    person_margin_m: float = 0.08
    person_radius_m: float = 0.25
    people_range_m: float = 3.5
    max_people: int = 8
    progress_weight: float = 1.0
    staying_weight: float = 0.5
    heading_weight: float = 0.25
    people_weight: float = 1.0
    people_decay_m: float = 0.25
    foresight_s: float = 0.8
    wall_weight: float = 0.3
    wall_decay_m: float = 0.12

    def __post_init__(self) -> None:
        for name in ("model_dt_s", "temperature", "vx_std_mps2", "wz_std_radps2"):
            if not getattr(self, name) > 0:
                raise SimError(f"{name} must be above 0, got {getattr(self, name)}; raise it")
        for name in ("batch_size", "time_steps", "noise_hold_steps"):
            if getattr(self, name) < 1:
                raise SimError(f"{name} must be at least 1, got {getattr(self, name)}; raise it")
