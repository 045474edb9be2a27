"""Whether a prediction of the arrival may be stated: what speaks against it, as plain clauses.

A time of arrival is taken to be outside the prediction where it is outside the central 90 % band of
the predicted law. Of n times some are by chance: as many as there are outside, or more, speak
against the prediction where they have a probability of at most 10 % if it is right,

    P(K >= k) <= 0.1,   K binomial with n trials of probability 0.1
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from serd_core.arrays import BoolArray, FloatArray, IntArray
from serd_core.arrival.bands import binomial_tail, clopper_pearson
from serd_core.arrival.law import SAME_TIME_S, ArrivalLaw
from serd_core.semi_markov.timed_decisions import TimedDecisions
from serd_sim.drivers.strategy import Strategy, start_distribution

#: Demonstrations that a prediction takes, and drives by the policy that count in their place.
FEWEST_DRIVES = 3
#: Shares between which nine in ten arrive.
BAND = 0.05, 0.95
_MOST_CHANCE = 0.1


@dataclass(frozen=True, eq=False)
class RecordedTimes:
    """When the recorded drives that reach the goal did so, since they began.

    times_s: (N,); outside: (N,) whether that is outside the band predicted from where they began.
    """

    times_s: FloatArray
    outside: BoolArray


@dataclass(frozen=True)
class Starts:
    """Cells in which drives begin; n_trapped: from which the learned policy does not arrive."""

    n_cells: int
    n_trapped: int


def recorded_times(
    strategy: Strategy, decisions: TimedDecisions, reaching: IntArray
) -> RecordedTimes:
    """The times of arrival of the recorded episodes that reach the goal, beside their prediction.

    decisions: up to the goal; reaching: (E,) numbers of these episodes, which arrive where their
    last decision ends.
    """
    times_s, outside = [], []
    for episode in reaching:
        rows = np.flatnonzero(decisions.episode == episode)
        ends_s = decisions.time_s[rows[-1]] + decisions.dwell_s[rows[-1]]
        time_s = float(ends_s - decisions.time_s[rows[0]])
        law = strategy.law_of_cell(int(decisions.state[rows[0]]))
        times_s.append(time_s)
        outside.append(bool(outside_band(law, time_s)))
    return RecordedTimes(np.array(times_s), np.array(outside, dtype=np.bool_))


def starts_of(strategy: Strategy, start_area: str) -> Starts:
    """The cells of a start area."""
    cells = np.flatnonzero(start_distribution(strategy.scenario, start_area))
    return Starts(len(cells), int(np.isin(cells, strategy.driven.learned_traps.states).sum()))


def outside_band(law: ArrivalLaw, times_s: ArrayLike) -> BoolArray:
    """Whether times, inf without an arrival, are outside the central 90 %.

    An end of the band that is never reached is at infinity.
    """
    low_s, high_s = (law.quantile_s(share) for share in BAND)
    times = np.asarray(times_s, dtype=np.float64)
    below = times < (np.inf if low_s is None else low_s) - SAME_TIME_S
    above = times > (np.inf if high_s is None else high_s) + SAME_TIME_S
    return np.asarray(below | above)


def reasons_against_prediction(
    *,
    n_demonstrations: int,
    starts: Starts,
    recorded: RecordedTimes | None = None,
    measured: tuple[ArrivalLaw, FloatArray] | None = None,
) -> tuple[str, ...]:
    """Why the predicted arrival must not be stated as such, one clause each; none where it may.

    recorded: times of the demonstrations, None where they are not at hand. measured: the prediction
    from these starts and the (N,) times of arrival of drives by the policy, inf without an arrival;
    with three of them the recorded times, which are those of persons, do not count.
    """
    found = []
    if n_demonstrations < FEWEST_DRIVES:
        found.append(
            f"a prediction takes at least {FEWEST_DRIVES} demonstrations, and the model was learned"
            f" from {n_demonstrations}"
        )
    if starts.n_trapped:
        cells = f"{starts.n_trapped} of the {starts.n_cells} cells"
        where = "the cell" if starts.n_cells == 1 else cells
        found.append(f"the learned policy does not arrive from {where} in which drives begin")
    n_measured = 0 if measured is None else len(measured[1])
    if recorded is not None and n_measured < FEWEST_DRIVES and _too_many(recorded.outside):
        found.append(_outside_text(recorded.outside, "recorded"))
    if measured is not None:
        found += _reasons_of_measured(*measured)
    return tuple(found)


def reasons_text(reasons: Sequence[str]) -> str:
    """The clauses as one, to stand after "because"."""
    return ", and because ".join(reasons)


def _reasons_of_measured(predicted: ArrivalLaw, times_s: FloatArray) -> Iterator[str]:
    outside = outside_band(predicted, times_s)
    if _too_many(outside):
        late = " or not at all" if np.isinf(times_s).any() else ""
        yield f"{_outside_text(outside, 'measured')}{late}"
    if predicted.quantile_s(BAND[1]) is not None:
        return
    # The band has no end, so that drives which do not arrive are in it: their share decides.
    n_arrived, computed = int(np.isfinite(times_s).sum()), float(predicted.cdf[-1])
    low, high = clopper_pearson([n_arrived], len(times_s))
    if not low[0] <= computed <= high[0]:
        yield (
            f"{n_arrived} of {len(times_s)} measured drives arrived, where the model computes"
            f" {computed:.0%}"
        )


def _too_many(outside: BoolArray) -> bool:
    """Whether more times are outside the band than chance explains."""
    return binomial_tail(int(outside.sum()), len(outside), 1.0 - BAND[1] + BAND[0]) <= _MOST_CHANCE


def _outside_text(outside: BoolArray, kind: str) -> str:
    share = f"{int(outside.sum())} of {len(outside)}"
    return f"{share} {kind} drives arrived outside the 90 % band that the model computes"
