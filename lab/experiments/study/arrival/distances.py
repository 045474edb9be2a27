"""How far predicted times of arrival are from measured ones, with intervals and a test.

Rows of both tables are CDFs by whole steps, one per repetition's model; their mean is
what is predicted for, and measured over, all episodes together.

    KS = max_n |F(n) - G(n)|
    W = D sum_(n < N) |F(n) - G(n)|   (Wasserstein up to the time limit N D, in s)
    error of the arrival probability = F(N) - G(N)
    mean time = D sum_(n < N) (1 - G(n)), where who has not arrived counts with the time limit
    CRPS = D sum_(n < N) (F_r(n) - 1[n >= N_arrived])^2   mean over repetitions r and their episodes

Means may hide errors of single models that cancel out; the CRPS, a proper score, does not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lab.experiments.running.statistics import StatisticsSettings, bootstrap
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray, IntArray

#: Sums of probabilities may pass 0 or 1 by this much.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class ArrivalTables:
    """predicted, measured: (R, N + 1); n_episodes: of each repetition; step_s: D."""

    predicted: FloatArray
    measured: FloatArray
    n_episodes: int
    step_s: float

    @property
    def scores(self) -> FloatArray:
        """(R,) mean CRPS of the episodes of each repetition, in seconds."""
        # The time limit ends the last whole step, so what stands at n = N lasts no time.
        predicted, measured = self.predicted[:, :-1], self.measured[:, :-1]
        terms = predicted**2 - 2.0 * predicted * measured + measured
        return np.asarray(self.step_s * terms.sum(axis=1))

    @property
    def measured_means_s(self) -> FloatArray:
        """(R,) mean measured time of each repetition, cut off at the time limit."""
        return np.asarray(self.step_s * (1.0 - self.measured[:, :-1]).sum(axis=1))


def distance_row(
    tables: ArrivalTables, settings: StatisticsSettings, rng: np.random.Generator
) -> Row:
    """All distances with bootstrap intervals over repetitions, and the test of the prediction."""
    row = distances(tables)
    for name, statistic in _STATISTICS.items():
        found = bootstrap(len(tables.measured), partial(statistic, tables), settings, rng)
        row |= {f"{name}_lower": found.lower, f"{name}_upper": found.upper}
    return row | {"ks_p_value": ks_p_value(tables, settings.bootstrap, rng)}


def distances(tables: ArrivalTables) -> Row:
    """Means, medians and all distances, without intervals."""
    every = np.arange(len(tables.measured))
    row: Row = {
        "n_episodes": tables.n_episodes * len(every),
        "predicted_arrival": float(tables.predicted[:, -1].mean()),
        "predicted_median_s": _median_s(tables.predicted, tables.step_s),
        "measured_median_s": _median_s(tables.measured, tables.step_s),
        "predicted_mean_s": _mean_s(tables.predicted, tables.step_s),
        "measured_mean_s": _mean_s(tables.measured, tables.step_s),
    }
    return row | {name: statistic(tables, every) for name, statistic in _STATISTICS.items()}


def ks_p_value(tables: ArrivalTables, n_drawn: int, rng: np.random.Generator) -> float:
    """How often episodes drawn from the predictions themselves are as far from them as measured.

    By simulation, since the CDFs are of whole steps, of several models, and may end below one.
    """
    seen = float(np.abs(_gap(tables, np.arange(len(tables.measured)))).max())
    shares = np.diff(np.clip(tables.predicted, 0.0, 1.0), axis=1, prepend=0.0, append=1.0)
    shares = np.maximum(shares, 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    centre = tables.predicted.mean(axis=0)
    beyond = 0
    for _ in range(n_drawn):
        counts = rng.multinomial(tables.n_episodes, shares)[:, :-1].cumsum(axis=1)
        drawn = (counts / tables.n_episodes).mean(axis=0)
        beyond += float(np.abs(centre - drawn).max()) >= seen - 1e-12
    return (1 + beyond) / (1 + n_drawn)


def _gap(tables: ArrivalTables, drawn: IntArray) -> FloatArray:
    """(N + 1,) F - G over the repetitions drawn, without the rounding errors of sums."""
    gap = (tables.predicted[drawn] - tables.measured[drawn]).mean(axis=0)
    return np.asarray(np.where(np.abs(gap) < ROUNDING, 0.0, gap))


def _median_s(cdfs: FloatArray, step_s: float) -> float | None:
    reached = np.flatnonzero(cdfs.mean(axis=0) >= 0.5)
    return float(step_s * reached[0]) if reached.size else None


def _mean_s(cdfs: FloatArray, step_s: float) -> float:
    """Mean of the time of arrival, cut off at the time limit."""
    return float(step_s * (1.0 - cdfs.mean(axis=0)[:-1]).sum())


#: Each of the repetitions drawn, whose indices may repeat.
_STATISTICS: dict[str, Callable[[ArrivalTables, IntArray], float]] = {
    "ks": lambda tables, drawn: float(np.abs(_gap(tables, drawn)).max()),
    "wasserstein_s": lambda tables, drawn: (
        tables.step_s * float(np.abs(_gap(tables, drawn)[:-1]).sum())
    ),
    "arrival_error": lambda tables, drawn: float(_gap(tables, drawn)[-1]),
    "crps_s": lambda tables, drawn: float(tables.scores[drawn].mean()),
    "measured_arrival": lambda tables, drawn: float(tables.measured[drawn, -1].mean()),
}
