"""Predicted against measured arrival: the figure, the table and the remarks of `serd navigate`."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure
from rich.table import Table

from report.figures.arrival import draw_arrival, measured_curve, predicted_curve, shown_until_s
from serd_app.learning.crossing_times import unseen_sentence
from serd_app.navigation.crossing_forecast import CrossingForecast
from serd_app.navigation.drive import DriveSettings
from serd_app.navigation.evaluation.comparison import Comparison, predicted_law
from serd_app.navigation.strategy import Strategy
from storage.episode_table import EpisodeResult
from storage.model_file import CrossingTimes
from storage.quantities import counted


def comparison_figure(
    strategy: Strategy, settings: DriveSettings, episodes: Sequence[EpisodeResult]
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
    low_s, high_s = map(_seconds, found.predicted_band_s)
    table.add_row("nine in ten between", f"{low_s} and {high_s}", f"{found.covered:.0%} did")
    return table


def remarks(found: Comparison, settings: DriveSettings, strategy: Strategy) -> list[str]:
    """Further results and warnings, one line each."""
    endings = ", ".join(f"{count} {ending}" for ending, count in found.outcomes.items())
    lines = [
        f"largest gap between predicted and measured share: {found.largest_gap:.2f} "
        f"(with arrivals at the ends of periods, as in the thesis: {found.largest_gap_thesis:.2f})",
        f"{counted(found.n_episodes, 'episode')}: {endings}; contacts: robot into people "
        f"{found.robot_on_person}, people into robot {found.person_on_robot}, walls "
        f"{found.robot_on_wall}",
    ]
    if strategy.times is None:
        lines.append(
            f"driven among {found.n_people} people; the model does not keep among how many it was "
            "learned: give --people where they were more or fewer"
        )
    else:
        lines.append(_of_times(strategy.times, strategy.crossings))
        lines += filter(None, [unseen_sentence(strategy.times)])
    if found.transferred:
        lines.append("the model was learned on another grid")
    if strategy.times is None and settings.lookahead_cells > 1:
        lines.append(
            "the prediction is for one cell per decision period, as demonstrated; with "
            f"--lookahead {settings.lookahead_cells} the robot is faster: give crossings.csv of"
            " such drives to 'serd learn --times'"
        )
    return [*lines, *filter(None, [strategy.scenario.period_remark, found.traps])]


def _of_times(times: CrossingTimes, forecast: CrossingForecast | None) -> str:
    """From what drives times are predicted."""
    low, high = times.people_pm2
    among = f"{low:.2f}" if low == high else f"{low:.2f} to {high:.2f}"
    more = forecast is not None and forecast.extrapolates
    return (
        f"predicted by the times in cells of {counted(times.n_episodes, 'drive')} with look-ahead"
        f" {times.lookahead_cells} among {among} people per m²"
        + (", which these drives are not" if more else "")
    )


def _seconds(time_s: float | None) -> str:
    return "never" if time_s is None else f"{time_s:.1f} s"
