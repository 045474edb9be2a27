"""Predicted against measured arrival of a series of episodes."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from serd_app.navigation.evaluation.prediction_support import (
    BAND,
    outside_band,
    reasons_against_prediction,
    starts_of,
)
from serd_app.navigation.forecast import HALF, MOST, plan_remarks
from serd_core.arrays import FloatArray
from serd_core.arrival.bands import clopper_pearson
from serd_core.arrival.law import ArrivalLaw
from serd_core.arrival.scores import crps_s, detectable_delay, gap_probability, largest_gap
from serd_files.episode_table import EpisodeResult
from serd_sim.drivers.strategy import Strategy, start_distribution


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
    times_s = np.array([row.time_of_arrival_s if row.arrived else math.inf for row in episodes])
    n_arrived = int(np.isfinite(times_s).sum())
    band_s = law.quantile_s(BAND[0]), law.quantile_s(BAND[1])
    low, high = clopper_pearson([n_arrived], len(episodes))
    return Comparison(
        **asdict(agreement(law, times_s)),
        n_episodes=len(episodes),
        n_arrived=n_arrived,
        outcomes=dict(Counter(_ending(row) for row in episodes)),
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
            measured=(law, times_s),
        ),
        transferred=strategy.transferred,
        n_people=strategy.scenario.pedestrians.count,
    )


def predicted_law(strategy: Strategy, start_area: str) -> ArrivalLaw:
    """Time of arrival from anywhere in a start area, up to the time-out."""
    return strategy.law_from(start_distribution(strategy.scenario, start_area))


def _ending(row: EpisodeResult) -> str:
    return f"{row.outcome} ({row.reason})" if row.reason else row.outcome


def _quantile_s(times_s: FloatArray, share: float) -> float | None:
    """First time by which a share of all has arrived."""
    value = float(np.sort(times_s)[math.ceil(share * len(times_s) - 1e-9) - 1])
    return value if math.isfinite(value) else None
