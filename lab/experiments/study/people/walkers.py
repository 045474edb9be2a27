"""Constant velocity: the distance over the speed so far, times what people differ by from that."""

from collections.abc import Sequence

import numpy as np

from lab.experiments.study.people.people import Asked, People
from serd_core.arrays import BoolArray, FloatArray
from serd_core.arrival.law import ArrivalLaw

CONSTANT_VELOCITY = "constant velocity"
_SLOWEST_MPS, _SOONEST_S = 0.2, 1e-3


def straight_laws(people: People, training: BoolArray, asked: Sequence[Asked]) -> list[ArrivalLaw]:
    """The forecasts asked for; training: (P,) of whom measured over predicted times are taken."""
    known = people.asked_of(training)
    factors = np.sort([one.duration_s / straight_s(people, one) for one in known])
    return [scaled_law(straight_s(people, one), factors, people.times_s) for one in asked]


def straight_s(people: People, one: Asked) -> float:
    """Seconds until a person is in the last column who keeps the mean speed along the corridor."""
    walker, run = people.walkers[one.walker], people.runs[people.run_of[one.walker]]
    here_m, since_s = walker.ahead_m(one.time_s), one.time_s - float(walker.time_s[0])
    speed_mps = (here_m - float(walker.position_m[0, 0])) / max(since_s, _SOONEST_S)
    return float(max((run.goal_line_m - here_m) / max(speed_mps, _SLOWEST_MPS), _SOONEST_S))


def scaled_law(time_s: float, factors: FloatArray, times_s: FloatArray) -> ArrivalLaw:
    """One time, multiplied by each of the sorted factors with the same probability."""
    cdf = np.searchsorted(time_s * factors, times_s, side="right") / len(factors)
    return ArrivalLaw(times_s, cdf, 1.0)
