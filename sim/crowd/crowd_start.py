"""How a crowd begins: who walks which loop, where, how far beside its line, and how fast."""

import numpy as np

from serd_core.arrays import FloatArray
from sim.crowd.crowd import Crowd
from sim.crowd.routes import Routes, offset_loop
from sim.crowd.social_force import model_named
from sim.scenario.settings import Loop, PedestrianSettings

_SPEED_DEVIATIONS = 2.0
_SLOWEST_MPS = 0.3


def people_per_loop(loops: tuple[Loop, ...], count: int) -> list[int]:
    """How many of `count` people walk each loop, by largest remainder of their shares."""
    wanted = np.array([loop.share for loop in loops])
    wanted = wanted / wanted.sum() * count
    people = np.floor(wanted).astype(int)
    for loop in np.argsort(people - wanted, kind="stable")[: count - int(people.sum())]:
        people[loop] += 1
    return [int(number) for number in people]


def start_crowd(
    settings: PedestrianSettings,
    loops: tuple[Loop, ...],
    walls_m: FloatArray,
    rng: np.random.Generator,
) -> Crowd:
    """Crowd spread over its loops, each walker at a random place, offset and wanted speed."""
    lines, shares = [], []
    for loop, people in zip(loops, people_per_loop(loops, settings.count), strict=True):
        corners = np.array(loop.waypoints_m)
        for place in range(people):
            offset = rng.uniform(-loop.lane_half_width_m, loop.lane_half_width_m)
            lines.append(offset_loop(corners, offset))
            shares.append((place + rng.uniform(0.0, 0.9)) / people)
    routes = Routes(lines)
    x_m, y_m = routes.place(np.array(shares))
    return Crowd(
        model=model_named(settings.model),
        routes=routes,
        x_m=x_m,
        y_m=y_m,
        desired_speed_mps=_truncated_speeds(settings, rng),
        walls_m=walls_m,
        fluctuation_mps2=settings.fluctuation_mps2,
        rng=rng,
    )


def _truncated_speeds(settings: PedestrianSettings, rng: np.random.Generator) -> FloatArray:
    """(N,) wanted speeds from N(mean, deviation), drawn again beyond two deviations."""
    standard = rng.standard_normal(settings.count)
    while (beyond := np.abs(standard) > _SPEED_DEVIATIONS).any():
        standard[beyond] = rng.standard_normal(int(beyond.sum()))
    speed = settings.desired_speed_mean_mps + settings.desired_speed_deviation_mps * standard
    return np.maximum(speed, _SLOWEST_MPS)
