"""Predicted against measured arrival, and what speaks against stating a prediction: checks that
failed when the model was learned (`serd_app.learning.criticism`), and drives by its policy."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from serd_app.learning.criticism import (
    BAND,
    FEWEST_DRIVES,
    RecordedTimes,
    outside_band,
    too_many,
)
from serd_app.navigation.navigator import HALF, MOST, plan_remarks
from serd_core.arrays import BoolArray, FloatArray
from serd_core.arrival.law import (
    ArrivalLaw,
    clopper_pearson,
    crps_s,
    detectable_delay,
    gap_probability,
    largest_gap,
)
from serd_files.model_file import Check
from serd_files.table import EpisodeResult
from serd_sim.drivers.strategy import Strategy, start_distribution


@dataclass(frozen=True)
class Starts:
    """Cells in which drives begin; n_trapped: from which the learned policy does not arrive."""

    n_cells: int
    n_trapped: int


def starts_of(strategy: Strategy, start_area: str) -> Starts:
    """The cells of a start area."""
    cells = np.flatnonzero(start_distribution(strategy.scenario, start_area))
    return Starts(len(cells), int(np.isin(cells, strategy.driven.learned_traps.states).sum()))


def reasons_against_prediction(
    *,
    n_demonstrations: int,
    starts: Starts,
    checks: Sequence[Check] = (),
    recorded: RecordedTimes | None = None,
    measured: tuple[ArrivalLaw, FloatArray] | None = None,
) -> tuple[str, ...]:
    """Why the predicted arrival must not be stated as such, one clause each; none where it may.

    checks: of the model file. recorded: times of the demonstrations, None where they are not at
    hand; those of the checks come first. measured: the prediction
    from these starts and the (N,) times of arrival of drives by the policy, inf without an arrival;
    with three of them the recorded times, which are those of persons, do not count.
    """
    n_measured = 0 if measured is None else len(measured[1])
    superseded = "arrival_times" if n_measured >= FEWEST_DRIVES else ""
    failed = {each.key: each.sentence for each in checks if each.mark == "fails"}
    found = [sentence for key, sentence in failed.items() if key != superseded]
    if n_demonstrations < FEWEST_DRIVES and "counts" not in failed:
        found.append(
            f"a prediction takes at least {FEWEST_DRIVES} demonstrations, and the model was learned"
            f" from {n_demonstrations}"
        )
    if starts.n_trapped and "ways" not in failed:
        cells = f"{starts.n_trapped} of the {starts.n_cells} cells"
        where = "the cell" if starts.n_cells == 1 else cells
        found.append(f"the learned policy does not arrive from {where} in which drives begin")
    tested = any(each.key == "arrival_times" for each in checks)
    if not tested and recorded is not None and n_measured < FEWEST_DRIVES:
        found += [_outside_text(recorded.outside, "recorded")] * too_many(recorded.outside)
    if measured is not None:
        found += _reasons_of_measured(*measured)
    return tuple(found)


def reasons_text(reasons: Sequence[str]) -> str:
    """The clauses as one, to stand after "because"."""
    return ", and because ".join(reasons)


def _reasons_of_measured(predicted: ArrivalLaw, times_s: FloatArray) -> Iterator[str]:
    outside = outside_band(predicted, times_s)
    if too_many(outside):
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


def _outside_text(outside: BoolArray, kind: str) -> str:
    share = f"{int(outside.sum())} of {len(outside)}"
    return f"{share} {kind} drives arrived outside the 90 % band that the model computes"


@dataclass(frozen=True)
class Agreement:
    """How well measured times agree with the predicted law.

    largest_gap: Kolmogorov-Smirnov distance of the law and the times, and gap_probability that of
    one as large if the prediction is right; detectable_delay: the factor by which drives must be
    slower for that test at 5 % to notice in four of five series like this one, None above 3.
    crps_s: mean continuous ranked probability score (s).
    """

    largest_gap: float
    gap_probability: float
    detectable_delay: float | None
    crps_s: float

    @property
    def gap_text(self) -> str:
        """The largest gap, with what it says about the prediction, and the score."""
        noticed = "not even drives that take three times as long would be noticed"
        if self.detectable_delay is not None:
            noticed = f"drives slower by a factor of {self.detectable_delay:.2f} would be noticed"
        return (
            f"{self.largest_gap:.2f}; one as large has a probability of {self.gap_probability:.2f}"
            f" if the prediction is right, and {noticed} in four of five such series; CRPS"
            f" {self.crps_s:.2f} s"
        )


def agreement(law: ArrivalLaw, arrival_times_s: FloatArray) -> Agreement:
    """That of a law with (N,) times, inf for an episode that did not arrive."""
    delay = detectable_delay(law, len(arrival_times_s))
    return Agreement(
        largest_gap=largest_gap(law, arrival_times_s),
        gap_probability=gap_probability(law, arrival_times_s),
        detectable_delay=delay if math.isfinite(delay) else None,
        crps_s=crps_s(law, arrival_times_s),
    )


@dataclass(frozen=True)
class Comparison(Agreement):
    """Times in seconds, None where so many never arrive.

    median_s, most_s: by which half and nine in ten of all episodes have arrived. predicted_band_s:
    from the 5 % to the 95 % quantile; covered: share of episodes that arrived within.
    n_least_time_states: those in which the way of least expected time is driven, as the learned
    policy does not arrive. no_prediction_because: reasons why what is predicted is not supported.
    """

    n_episodes: int
    n_arrived: int
    outcomes: dict[str, int]
    predicted_probability: float
    measured_probability: float
    measured_interval_95: tuple[float, float]
    predicted_median_s: float | None
    measured_median_s: float | None
    predicted_most_s: float | None
    measured_most_s: float | None
    predicted_band_s: tuple[float | None, float | None]
    covered: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    n_trap_states: int
    n_least_time_states: int
    plan_remarks: tuple[str, ...]
    no_prediction_because: tuple[str, ...]
    transferred: bool
    n_people: int


def compare(strategy: Strategy, start_area: str, episodes: Sequence[EpisodeResult]) -> Comparison:
    """Compare the prediction from a start area with the episodes."""
    starts = start_distribution(strategy.scenario, start_area)
    law = strategy.law_from(starts)
    times_s = arrival_times_s(episodes)
    n_arrived = int(np.isfinite(times_s).sum())
    endings = (f"{row.outcome} ({row.reason})" if row.reason else row.outcome for row in episodes)
    band_s = law.quantile_s(BAND[0]), law.quantile_s(BAND[1])
    low, high = clopper_pearson([n_arrived], len(episodes))
    return Comparison(
        **asdict(agreement(law, times_s)),
        n_episodes=len(episodes),
        n_arrived=n_arrived,
        outcomes=dict(Counter(endings)),
        predicted_probability=float(law.cdf[-1]),
        measured_probability=n_arrived / len(episodes),
        measured_interval_95=(float(low[0]), float(high[0])),
        predicted_median_s=law.quantile_s(HALF),
        measured_median_s=_quantile_s(times_s, HALF),
        predicted_most_s=law.quantile_s(MOST),
        measured_most_s=_quantile_s(times_s, MOST),
        predicted_band_s=band_s,
        covered=float(np.mean(np.isfinite(times_s) & ~outside_band(law, times_s))),
        robot_on_person=sum(row.robot_on_person for row in episodes),
        person_on_robot=sum(row.person_on_robot for row in episodes),
        robot_on_wall=sum(row.robot_on_wall for row in episodes),
        n_trap_states=len(strategy.traps.states),
        n_least_time_states=int(strategy.by_time.sum()),
        plan_remarks=tuple(plan_remarks(strategy)),
        no_prediction_because=reasons_against_prediction(
            n_demonstrations=strategy.file.fit.n_episodes,
            starts=starts_of(strategy, start_area),
            checks=strategy.file.checks,
            measured=(law, times_s),
        ),
        transferred=strategy.transferred,
        n_people=strategy.scenario.pedestrians.count,
    )


def arrival_times_s(episodes: Sequence[EpisodeResult]) -> FloatArray:
    """(N,) time of arrival of each episode, inf where it did not arrive."""
    return np.array([row.time_of_arrival_s if row.arrived else math.inf for row in episodes])


def predicted_law(strategy: Strategy, start_area: str) -> ArrivalLaw:
    """Time of arrival from anywhere in a start area, up to the time-out."""
    return strategy.law_from(start_distribution(strategy.scenario, start_area))


def _quantile_s(times_s: FloatArray, share: float) -> float | None:
    """First time by which a share of all has arrived."""
    value = float(np.sort(times_s)[math.ceil(share * len(times_s) - 1e-9) - 1])
    return value if math.isfinite(value) else None
