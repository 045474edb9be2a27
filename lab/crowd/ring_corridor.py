"""A straight corridor closed to a ring: crowds of a fixed density, for validation.

People walk along x; who leaves at one end comes in at the other. Walls are at y = 0 and y = width.
"""

import numpy as np
import scipy  # loads special at its first use

from serd_core.arrays import FloatArray
from serd_sim.crowd.crowd import Crowd
from serd_sim.crowd.routes import Routes
from serd_sim.crowd.social_force import model_named
from serd_sim.errors import SimError
from serd_sim.scenario.rules import DENSITY_AT_WHICH_NOBODY_WALKS_PM2

_FAR_M = 1e7
#: Of the wanted speeds.
_MEAN_MPS, _DEVIATION_MPS = 1.34, 0.26


def ring_corridor_crowd(
    *,
    width_m: float,
    length_m: float,
    density_pm2: float,
    share_backwards: float = 0.0,
    keep_right: bool = False,
    model_name: str = "collision_prediction",
    rng: np.random.Generator,
) -> Crowd:
    """Crowd of round(density * area) people on a jittered lattice; a share walks towards -x.

    Wanted speeds are spread evenly over the quantiles of the normal distribution, so that even a
    small crowd has its mean. With keep_right, those who walk towards +x begin on the side of y = 0.
    """
    count = round(density_pm2 * width_m * length_m)
    if count < 1:
        raise SimError(
            f"density_pm2 must give at least one person, got {density_pm2} on "
            f"{width_m * length_m} m2; raise it or lengthen the ring"
        )
    x_m, y_m = _lattice(count, width_m, length_m, rng)
    rank = np.argsort(np.argsort(-y_m, kind="stable")) if keep_right else rng.permutation(count)
    backwards = rank < round(share_backwards * count)
    loops = [endless_lane(y, -1.0 if back else 1.0) for y, back in zip(y_m, backwards, strict=True)]
    routes = Routes(loops)
    routes.place(np.full(count, 1.0 / 6.0))
    quantiles = scipy.special.ndtri((np.arange(count) + 0.5) / count)
    return Crowd(
        model=model_named(model_name),
        routes=routes,
        x_m=x_m,
        y_m=y_m,
        desired_speed_mps=rng.permutation(_MEAN_MPS + _DEVIATION_MPS * quantiles),
        walls_m=np.array(
            [[[-1e3, 0.0], [1e3, 0.0]], [[1e3, width_m], [-1e3, width_m]]], dtype=np.float64
        ),
        fluctuation_mps2=0.1,
        rng=rng,
        period_m=length_m,
    )


def weidmann_speed_mps(density_pm2: FloatArray) -> FloatArray:
    """Weidmann (1993): v = 1.34 (1 - exp(-1.913 (1 / rho - 1 / 5.4)))."""
    standstill = 1.0 / DENSITY_AT_WHICH_NOBODY_WALKS_PM2
    speed: FloatArray = 1.34 * (1.0 - np.exp(-1.913 * (1.0 / np.asarray(density_pm2) - standstill)))
    return speed


def _lattice(
    count: int, width_m: float, length_m: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    columns = int(np.ceil(np.sqrt(count * length_m / width_m)))
    rows = int(np.ceil(count / columns))
    slot = rng.permutation(columns * rows)[:count]
    jitter = rng.uniform(-0.1, 0.1, (2, count))
    x_m = (slot % columns + 0.5) * length_m / columns + jitter[0]
    y_m = 0.3 + (slot // columns + 0.5) * (width_m - 0.6) / rows + jitter[1]
    return np.mod(x_m, length_m), np.clip(y_m, 0.2, width_m - 0.2)


def endless_lane(y_m: float, direction: float) -> FloatArray:
    """A square loop so large that its first side is a straight line for ever."""
    end = direction * _FAR_M
    return np.array([[-end, y_m], [end, y_m], [end, y_m + _FAR_M], [-end, y_m + _FAR_M]])
