"""Both crowd models at several densities, compared with measured crowds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sim.crowd.corridor_measures import CorridorMeasures, measure_simulation
from sim.crowd.ring_corridor import ring_corridor_crowd, weidmann_speed_mps

ONE_WAY_DENSITIES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
TWO_WAY_DENSITIES = (0.5, 0.75, 1.0, 1.25)
_STEP_S = 0.05


@dataclass(frozen=True)
class ComparedSpeed:
    """One model at one density; passing_distance_m and recorded values are NaN where unknown."""

    model: str
    flow: str
    density_pm2: float
    speed_mps: float
    expected_speed_mps: float
    passing_distance_m: float = float("nan")
    expected_passing_distance_m: float = float("nan")


def compare_one_way(
    model: str, densities: Sequence[float] = ONE_WAY_DENSITIES, *, seed: int = 1
) -> Iterator[ComparedSpeed]:
    """Mean speed along a ring corridor of 4 m after 20 s, against Weidmann's."""
    for density in densities:
        yield ComparedSpeed(
            model, "one way", density, one_way_speed_mps(model, density, seed=seed),
            float(weidmann_speed_mps(np.array(density))),
        )  # fmt: skip


def one_way_speed_mps(
    model: str, density_pm2: float, *, seed: int, settle_s: float = 20.0, duration_s: float = 30.0
) -> float:
    """Mean over people and time of the speed along the corridor."""
    crowd = ring_corridor_crowd(
        width_m=4.0,
        length_m=20.0,
        density_pm2=density_pm2,
        model_name=model,
        rng=np.random.default_rng(seed),
    )
    along = []
    for step in range(round((settle_s + duration_s) / _STEP_S)):
        crowd.step(_STEP_S)
        if step * _STEP_S >= settle_s:
            along.append(crowd.velocity_x_mps.mean())
    return float(np.mean(along))


def compare_two_ways(
    model: str,
    recorded: CorridorMeasures,
    densities: Sequence[float] = TWO_WAY_DENSITIES,
    *,
    seed: int = 1,
) -> Iterator[ComparedSpeed]:
    """Two-way traffic in the corridor of a recording, at densities that it holds."""
    for density in densities:
        real = recorded.near_density(density)
        if not len(real.speed_mps):
            continue
        walked = measure_simulation(density, model_name=model, seed=seed)
        yield ComparedSpeed(
            model,
            "two ways",
            density,
            float(walked.speed_mps.mean()),
            float(real.speed_mps.mean()),
            float(np.nanmedian(walked.passing_distance_m)),
            float(np.nanmedian(real.passing_distance_m)),
        )
