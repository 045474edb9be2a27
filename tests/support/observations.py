"""Observations for tests, with the control period of the built-in scenarios."""

import numpy as np

from serd_sim.world.observation import Observation

PERIOD_S = 0.05


def observation_at(
    x_m: float,
    y_m: float,
    yaw_rad: float = 0.0,
    *,
    time_s: float | None = None,
    tick: int = 0,
    speed_mps: float = 0.0,
    yaw_rate_radps: float = 0.0,
    people=(),
    velocity=None,
) -> Observation:
    """Observation of a robot at a pose, by default at rest, at time 0 and with no people.

    time_s: sets the tick too; else the time follows from `tick`. people, velocity: (N, 2) positions
    and velocities; people stand by default.
    """
    position = np.asarray(people, dtype=np.float64).reshape(-1, 2)
    return Observation(
        time_s=tick * PERIOD_S if time_s is None else time_s,
        tick=tick if time_s is None else round(time_s / PERIOD_S),
        pose=(x_m, y_m, yaw_rad),
        speed_mps=speed_mps,
        yaw_rate_radps=yaw_rate_radps,
        people_position_m=position,
        people_velocity_mps=np.zeros_like(position) if velocity is None else velocity,
        people_id=np.arange(len(position)),
    )
