"""The crowd models at several densities, compared with measured crowds.

Columns are `model`, `place`, `flow` and `density_pm2`; of simulated people and, as `measured_...`,
of the measured ones: `speed_mps`, its mean; `speed_deviation_mps`, the standard deviation of
persons' speeds; `nearest_m`, which 5 % of the nearest neighbours fall below; `passing_m`, the
median over moments of the smallest distance of two who walk opposite ways; and `deviations`, the
difference of the mean speeds in standard deviations of the measured one. NaN where unknown.
"""

from collections.abc import Iterator

import numpy as np

from lab.crowd.corridor_measures import Corridor, CorridorMeasures, measure_simulation
from lab.crowd.ring_corridor import weidmann_speed_mps
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray

DENSITIES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)
#: Fewest recorded speeds (of persons at moments) at a density that are compared.
_LEAST_RECORDED = 100


def compare_with_weidmann(model: str) -> Iterator[Row]:
    """One way in a ring corridor of 4 m, against the mean speeds of Weidmann (1993)."""
    for density in DENSITIES:
        walked = measure_simulation(
            density, model_name=model, share_backwards=0.0, keep_right=False
        )
        expected = dict.fromkeys(_walking(walked), float("nan"))
        expected["speed_mps"] = float(weidmann_speed_mps(np.array(density)))
        yield _row(model, "Weidmann", "one way", density, _walking(walked), expected)


def compare_with_recording(
    model: str, name: str, corridor: Corridor, recorded: CorridorMeasures
) -> Iterator[Row]:
    """A ring corridor as wide as the recorded one, at the densities that the recording holds."""
    for density in DENSITIES:
        real = recorded.near_density(density)
        if len(real.person_speed_mps) < _LEAST_RECORDED:
            continue
        both_ways = corridor.flow == "two ways"
        walked = measure_simulation(
            density,
            model_name=model,
            width_m=corridor.width_m,
            share_backwards=corridor.share_backwards if both_ways else 0.0,
            keep_right=both_ways,
        )
        yield _row(model, name, corridor.flow, density, _walking(walked), _walking(real))


def _row(
    model: str, place: str, flow: str, density_pm2: float, simulated: Row, measured: Row
) -> Row:
    away_mps = simulated["speed_mps"] - measured["speed_mps"]
    row: Row = {"model": model, "place": place, "flow": flow, "density_pm2": density_pm2}
    row |= simulated | {f"measured_{name}": value for name, value in measured.items()}
    return row | {"deviations": away_mps / measured["speed_deviation_mps"]}


def _walking(measures: CorridorMeasures) -> Row:
    return {
        "speed_mps": float(measures.speed_mps.mean()),
        "speed_deviation_mps": float(measures.person_speed_mps.std()),
        "nearest_m": float(np.quantile(measures.nearest_m, 0.05)),
        "passing_m": _median(measures.passing_distance_m),
    }


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
