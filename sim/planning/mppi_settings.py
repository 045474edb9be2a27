"""Settings of the path-integral planner."""

from dataclasses import dataclass, field

from sim.errors import SimError
from sim.planning.cost_settings import CostSettings


@dataclass(frozen=True)
class MppiSettings:
    """batch_size rollouts of time_steps steps of model_dt_s; temperature of the weighting.

    vx_std_mps2, wz_std_radps2: deviations of the sampled accelerations, held over noise_hold_steps.
    Names as in Nav2's MPPI controller.
    """

    xy_goal_tolerance_m: float = 0.1
    batch_size: int = 300
    time_steps: int = 14
    model_dt_s: float = 0.1
    temperature: float = 0.08
    vx_std_mps2: float = 2.0
    wz_std_radps2: float = 6.0
    noise_hold_steps: int = 2
    braking_share: float = 0.7
    seed: int = 1
    costs: CostSettings = field(
        default_factory=lambda: CostSettings(staying_weight=0.5, people_weight=1.0)
    )

    def __post_init__(self) -> None:
        for name in ("model_dt_s", "temperature", "vx_std_mps2", "wz_std_radps2"):
            if not getattr(self, name) > 0:
                raise SimError(f"{name} must be above 0, got {getattr(self, name)}; raise it")
        for name, least in (("batch_size", 2), ("time_steps", 2), ("noise_hold_steps", 1)):
            if getattr(self, name) < least:
                value = getattr(self, name)
                raise SimError(f"{name} must be at least {least}, got {value}; raise it")
