"""The two arrival curves of a report: predicted by the model, measured on the episodes."""

import numpy as np

from report.episode_row import EpisodeRow
from report.figures.arrival import ArrivalCurve
from serd_core.arrays import FloatArray
from serd_core.arrival.bands import empirical_arrival_cdf, sampling_band
from serd_core.arrival.law import ArrivalLaw


def predicted_curve(predicted: ArrivalLaw, n_episodes: int) -> ArrivalCurve:
    """Predicted CDF; the band is where the share of `n_episodes` episodes would fall in 95 %."""
    lower, upper = sampling_band(predicted.cdf, n_episodes)
    return ArrivalCurve(predicted.times_s, predicted.cdf, lower, upper)


def measured_curve(episodes: tuple[EpisodeRow, ...], timeout_s: float) -> ArrivalCurve:
    """Empirical CDF with its exact 95 % confidence band; aborted episodes count as not arrived."""
    late = [not row.arrived for row in episodes]
    times = [0.0 if row.time_of_arrival_s is None else row.time_of_arrival_s for row in episodes]
    empirical = empirical_arrival_cdf(times, late, timeout_s)
    return ArrivalCurve(empirical.times_s, empirical.cdf, empirical.lower, empirical.upper)


def at_times(curve: ArrivalCurve, times_s: FloatArray) -> ArrivalCurve:
    """The step functions of `curve` read at other times; zero before its first."""
    index = np.searchsorted(curve.time_s, times_s, side="right") - 1
    before = index < 0
    return ArrivalCurve(
        time_s=times_s,
        probability=np.where(before, 0.0, curve.probability[index]),
        lower=np.where(before, 0.0, curve.lower[index]),
        upper=np.where(before, 0.0, curve.upper[index]),
    )


def largest_gap(predicted: ArrivalCurve, measured: ArrivalCurve) -> float:
    """Largest difference of the two step functions, looked at whenever `predicted` may step.

    This is the Kolmogorov-Smirnov distance of times rounded up to those that the model knows of.
    """
    difference = predicted.probability - at_times(measured, predicted.time_s).probability
    return float(np.abs(difference).max())


def time_reaching(curve: ArrivalCurve, share: float) -> float | None:
    """First time at which the curve is at or above `share`, None if it never is."""
    reached = np.flatnonzero(curve.probability >= share - 1e-12)
    return float(curve.time_s[reached[0]]) if reached.size else None
