"""Predicted against measured arrival of one drive, as numbers and as a table."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from report.figures.arrival import draw_arrival, measured_curve, predicted_curve, shown_until_s
from report.style import counted
from serd_app.navigation.forecast_text import traps_in_words
from serd_app.navigation.navigator import HALF, MOST
from serd_app.navigation.strategy import Strategy, start_distribution
from serd_cli.navigate.settings import NavigateSettings
from serd_core.arrival.bands import clopper_pearson
from serd_core.arrival.law import ArrivalLaw, largest_gap, law_in_seconds
from storage.episode_table import EpisodeResult


@dataclass(frozen=True)
class Comparison:
    """Times in seconds, None where so many never arrive.

    median_s, most_s: by which half and nine in ten of all episodes have arrived. largest_gap:
    Kolmogorov-Smirnov distance of the predicted law and the measured times; largest_gap_thesis: of
    the thesis's law, which dates arrivals to the ends of decision periods.
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
    largest_gap: float
    largest_gap_thesis: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    n_trap_states: int
    traps: str
    transferred: bool
    n_people: int

    def values(self) -> dict[str, Any]:
        """The record as plain values."""
        return asdict(self)


def compare(
    strategy: Strategy, settings: NavigateSettings, episodes: Sequence[EpisodeResult]
) -> Comparison:
    """Hold the prediction from the start area against the episodes."""
    starts = start_distribution(strategy.scenario, settings.start_area)
    counts = strategy.predicted_arrival(starts, strategy.n_periods)
    law = predicted_law(strategy, settings.start_area)
    thesis = law_in_seconds(counts, period_s=strategy.scenario.decision_period_s)
    times_s = np.array([row.time_of_arrival_s if row.arrived else math.inf for row in episodes])
    n_arrived = int(np.isfinite(times_s).sum())
    low, high = clopper_pearson([n_arrived], len(episodes))
    return Comparison(
        n_episodes=len(episodes),
        n_arrived=n_arrived,
        outcomes=dict(Counter(_ending(row) for row in episodes)),
        predicted_probability=float(counts.cdf[-1]),
        measured_probability=n_arrived / len(episodes),
        measured_interval_95=(float(low[0]), float(high[0])),
        predicted_median_s=law.quantile_s(HALF),
        measured_median_s=_quantile_s(times_s, HALF),
        predicted_most_s=law.quantile_s(MOST),
        measured_most_s=_quantile_s(times_s, MOST),
        largest_gap=largest_gap(law, times_s),
        largest_gap_thesis=largest_gap(thesis, times_s),
        robot_on_person=sum(row.robot_on_person for row in episodes),
        person_on_robot=sum(row.person_on_robot for row in episodes),
        robot_on_wall=sum(row.robot_on_wall for row in episodes),
        n_trap_states=len(strategy.traps.states),
        traps=traps_in_words(strategy.traps),
        transferred=strategy.transferred,
        n_people=strategy.scenario.pedestrians.count,
    )


def comparison_figure(
    strategy: Strategy, settings: NavigateSettings, episodes: Sequence[EpisodeResult]
) -> Figure:
    """Predicted and measured share of arrivals over time, with bands."""
    law = predicted_law(strategy, settings.start_area)
    times_s = [row.time_of_arrival_s if row.arrived else math.inf for row in episodes]
    return draw_arrival(
        predicted_curve(law, len(episodes)),
        measured_curve(times_s, settings.timeout_s),
        n_episodes=len(episodes),
        shown_until_s=shown_until_s(law, times_s, settings.timeout_s),
    )


def predicted_law(strategy: Strategy, start_area: str) -> ArrivalLaw:
    """Time of arrival from anywhere in a start area, up to the time-out."""
    starts = start_distribution(strategy.scenario, start_area)
    return strategy.law_s(strategy.predicted_arrival(starts, strategy.n_periods))


def comparison_table(found: Comparison) -> Table:
    """One row per quantity: predicted, measured."""
    table = Table(title="Arrival", title_justify="left")
    table.add_column("", no_wrap=True)
    table.add_column("predicted", justify="right")
    table.add_column("measured", justify="right")
    low, high = found.measured_interval_95
    share = f"{found.n_arrived} of {found.n_episodes} ({low:.0%} to {high:.0%})"
    table.add_row("arrives in time", f"{found.predicted_probability:.1%}", share)
    for name, predicted_s, measured_s in (
        ("half of all by", found.predicted_median_s, found.measured_median_s),
        ("nine in ten by", found.predicted_most_s, found.measured_most_s),
    ):
        table.add_row(name, _seconds(predicted_s), _seconds(measured_s))
    return table


def remarks(found: Comparison, settings: NavigateSettings) -> list[str]:
    """What else there is to say, one line each."""
    endings = ", ".join(f"{count} {ending}" for ending, count in found.outcomes.items())
    lines = [
        f"largest gap between predicted and measured share: {found.largest_gap:.2f} "
        f"(with arrivals at the ends of periods, as in the thesis: {found.largest_gap_thesis:.2f})",
        f"{counted(found.n_episodes, 'episode')}: {endings}; contacts: robot into people "
        f"{found.robot_on_person}, people into robot {found.person_on_robot}, walls "
        f"{found.robot_on_wall}",
        f"driven among {found.n_people} people; the model does not keep among how many it was "
        "learned: give --people where they were more or fewer",
    ]
    if found.transferred:
        lines.append("the model was learned on another grid")
    if settings.lookahead_cells > 1:
        lines.append(
            "the prediction is for one cell per decision period, as demonstrated; with "
            f"--lookahead {settings.lookahead_cells} the robot is faster"
        )
    return lines + ([found.traps] if found.traps else [])


def _ending(row: EpisodeResult) -> str:
    return f"{row.outcome} ({row.reason})" if row.reason else row.outcome


def _quantile_s(times_s: np.ndarray[Any, Any], share: float) -> float | None:
    """First time by which a share of all has arrived."""
    value = float(np.sort(times_s)[math.ceil(share * len(times_s) - 1e-9) - 1])
    return value if math.isfinite(value) else None


def _seconds(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s:.1f} s"
