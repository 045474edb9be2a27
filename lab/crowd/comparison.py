"""The crowd models at several densities, compared with measured crowds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lab.crowd.corridor_measures import Corridor, CorridorMeasures, measure_simulation
from lab.crowd.ring_corridor import weidmann_speed_mps
from serd_core.arrays import FloatArray

DENSITIES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)
#: Fewest recorded speeds (of persons at moments) at a density that are compared.
_LEAST_RECORDED = 100
_UNKNOWN = float("nan")


@dataclass(frozen=True)
class Walking:
    """Means over moments; NaN where unknown.

    speed_deviation_mps: standard deviation of persons' speeds. nearest_m: distance of centres that
    5 % of the nearest neighbours fall below. passing_m: median over moments of the smallest
    distance of two who walk opposite ways.
    """

    speed_mps: float
    speed_deviation_mps: float = _UNKNOWN
    nearest_m: float = _UNKNOWN
    passing_m: float = _UNKNOWN


@dataclass(frozen=True)
class ComparedCrowd:
    """One model at one density, beside what was measured there."""

    model: str
    place: str
    flow: str
    density_pm2: float
    simulated: Walking
    measured: Walking

    @property
    def deviations(self) -> float:
        """Difference of the mean speeds in standard deviations of the measured one."""
        away = self.simulated.speed_mps - self.measured.speed_mps
        return away / self.measured.speed_deviation_mps


def compare_with_weidmann(
    model: str, densities: Sequence[float] | None = None, *, seed: int = 1
) -> Iterator[ComparedCrowd]:
    """One way in a ring corridor of 4 m, against the mean speeds of Weidmann (1993)."""
    for density in densities or DENSITIES:
        walked = measure_simulation(
            density, model_name=model, share_backwards=0.0, keep_right=False, seed=seed
        )
        expected = Walking(float(weidmann_speed_mps(np.array(density))))
        yield ComparedCrowd(model, "Weidmann", "one way", density, _walking(walked), expected)


def compare_with_recording(
    model: str,
    name: str,
    corridor: Corridor,
    recorded: CorridorMeasures,
    densities: Sequence[float] | None = None,
    *,
    seed: int = 1,
) -> Iterator[ComparedCrowd]:
    """A ring corridor as wide as the recorded one, at the densities that the recording holds."""
    for density in densities or DENSITIES:
        real = recorded.near_density(density)
        if len(real.person_speed_mps) < _LEAST_RECORDED:
            continue
        walked = measure_simulation(
            density,
            model_name=model,
            width_m=corridor.width_m,
            share_backwards=corridor.share_backwards if corridor.flow == "two ways" else 0.0,
            keep_right=corridor.flow == "two ways",
            seed=seed,
        )
        yield ComparedCrowd(model, name, corridor.flow, density, _walking(walked), _walking(real))


def _walking(measures: CorridorMeasures) -> Walking:
    return Walking(
        float(measures.speed_mps.mean()),
        float(measures.person_speed_mps.std()),
        float(np.quantile(measures.nearest_m, 0.05)),
        _median(measures.passing_distance_m),
    )


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else _UNKNOWN
