"""Scores of forecasts of one time, and forecasts without a model to compare with."""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.arrival.law import SAME_TIME_S, ArrivalLaw
from serd_core.errors import SerdError


def crps_s(law: ArrivalLaw, time_s: float) -> float:
    """Continuous ranked probability score up to the last step of the law, or the time if later.

        CRPS(F, T) = integral of (F(t) - 1[t >= T])^2 dt     (Gneiting and Raftery, JASA 102, 2007)

    in seconds, the absolute error where F is a point.
    """
    if not (np.isfinite(time_s) and time_s >= 0):
        raise SerdError(
            f"time_s must be finite and not negative, got {time_s}; score arrivals only"
        )
    ends_s = np.unique(np.concatenate([[0.0, time_s], law.times_s]))
    begins_s = ends_s[:-1]
    away = law.probability_by(begins_s) - (begins_s >= time_s)
    return float(np.sum(away**2 * np.diff(ends_s)))


def integral_transform(law: ArrivalLaw, time_s: float) -> float:
    """(P(T < t) + P(T <= t)) / 2: uniform between 0 and 1 for times that follow the law.

    A law of even steps stands for a continuous one: half a step before and after the time.
    """
    steps_s = np.diff(law.times_s)
    even = len(steps_s) > 0 and np.allclose(steps_s, steps_s[0], rtol=0, atol=SAME_TIME_S)
    half_s = max(steps_s[0] / 2 if even else 0.0, SAME_TIME_S)
    return float(law.probability_by([time_s - half_s - SAME_TIME_S, time_s + half_s]).mean())


def point_law(time_s: float) -> ArrivalLaw:
    """The forecast of one time, without doubt."""
    return ArrivalLaw(np.array([time_s]), np.ones(1), 1.0)


def scaled_point_law(time_s: float, factors: FloatArray) -> ArrivalLaw:
    """One time, multiplied by each of the factors with the same probability."""
    times_s = np.sort(time_s * np.asarray(factors, dtype=np.float64))
    return ArrivalLaw(times_s, np.arange(1, len(times_s) + 1) / len(times_s), 1.0)
