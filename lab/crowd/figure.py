"""Simulated and measured crowds: speed over density, and distances between people."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.learner_curves import LearnerStyle
from serd_app.report import style
from serd_app.report.style import new_figure

_LOOKS = (
    LearnerStyle(style.BLUE, "o"),
    LearnerStyle(style.GREEN, "D", "-."),
    LearnerStyle(style.PURPLE, "s", "--"),
    LearnerStyle(style.YELLOW, "^", ":"),
)
_MEASURES = {
    "speed_mps": "mean speed, m/s",
    "nearest_m": "nearest neighbour,\n5 % are nearer, m",
    "passing_m": "nearest oncoming person,\nmedian, m",
}


def draw_crowd_comparison(table: pd.DataFrame) -> Figure:
    """A column per place, a row per measure; the band is one standard deviation of speeds.

    table: of the rows of `lab.crowd.comparison`.
    """
    places = [rows for _, rows in table.groupby(["place", "flow"], sort=False)]
    shown = [name for name in _MEASURES if any(_is_drawn(rows, name) for rows in places)]
    with style.report_style():
        figure = new_figure(3.4 * len(places) + 0.6, 2.6 * len(shown) + 0.9)
        panels = figure.subplots(len(shown), len(places), squeeze=False)
        for column, rows in enumerate(places):
            panels[0, column].set_title(f"{rows['place'].iloc[0]}, {rows['flow'].iloc[0]}")
            for axes, name in zip(panels[:, column], shown, strict=True):
                _draw(axes, rows, name)
                if column == 0 or not _is_drawn(places[column - 1], name):
                    axes.set_ylabel(_MEASURES[name])
            drawn = [row for row, name in enumerate(shown) if _is_drawn(rows, name)]
            panels[drawn[-1], column].set_xlabel("people per m²")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(handles)))
    return figure


def _is_drawn(rows: pd.DataFrame, measure: str) -> bool:
    """Whether there is something to compare; nearest neighbours are shown in any case."""
    return measure == "nearest_m" or bool(rows[f"measured_{measure}"].notna().any())


def _draw(axes: Axes, rows: pd.DataFrame, measure: str) -> None:
    if not _is_drawn(rows, measure):
        axes.set_axis_off()
        return
    models = list(rows.groupby("model", sort=False))
    _, one = models[0]
    density, values = one["density_pm2"], one[f"measured_{measure}"]
    axes.plot(density, values, color=style.INK, linewidth=2.0, label="measured")
    if measure == "speed_mps":
        band = one["measured_speed_deviation_mps"]
        axes.fill_between(density, values - band, values + band, color=style.INK, alpha=0.12, lw=0)
    for (name, mine), look in zip(models, _LOOKS, strict=False):
        label = str(name).replace("_", " ")
        axes.plot(mine["density_pm2"], mine[measure], label=label, **look.arguments)
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.grid()
