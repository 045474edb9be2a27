"""Simulated and measured crowds: speed over density, and distances between people."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.learner_curves import LearnerStyle
from serd_app.report import style
from serd_app.report.style import new_figure
from serd_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class CrowdCurve:
    """(D,) at each density: mean speed, its deviation, distances; NaN where unknown."""

    name: str
    density_pm2: FloatArray
    speed_mps: FloatArray
    speed_deviation_mps: FloatArray
    nearest_m: FloatArray
    passing_m: FloatArray


@dataclass(frozen=True, eq=False)
class CrowdPlace:
    """The measured people of one place, and each model there."""

    title: str
    measured: CrowdCurve
    simulated: Sequence[CrowdCurve]


_LOOKS = (
    LearnerStyle(style.BLUE, "o"),
    LearnerStyle(style.GREEN, "D", "-."),
    LearnerStyle(style.PURPLE, "s", "--"),
    LearnerStyle(style.YELLOW, "^", ":"),
)
_MEASURES = (
    ("speed_mps", "mean speed, m/s"),
    ("nearest_m", "nearest neighbour,\n5 % are nearer, m"),
    ("passing_m", "nearest oncoming person,\nmedian, m"),
)


def draw_crowd_comparison(places: Sequence[CrowdPlace]) -> Figure:
    """A column per place, a row per measure; the band is one standard deviation of speeds."""
    rows = [each for each in _MEASURES if any(_is_drawn(place, each[0]) for place in places)]
    with style.report_style():
        figure = new_figure(3.4 * len(places) + 0.6, 2.6 * len(rows) + 0.9)
        panels = figure.subplots(len(rows), len(places), squeeze=False)
        for column, place in enumerate(places):
            panels[0, column].set_title(place.title)
            for axes, (measure, label) in zip(panels[:, column], rows, strict=True):
                _draw(axes, place, measure)
                if column == 0 or not _is_drawn(places[column - 1], measure):
                    axes.set_ylabel(label)
            drawn = [row for row, each in enumerate(rows) if _is_drawn(place, each[0])]
            panels[drawn[-1], column].set_xlabel("people per m²")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(handles)))
    return figure


def _is_drawn(place: CrowdPlace, measure: str) -> bool:
    """Whether there is something to compare; nearest neighbours are shown in any case."""
    curves = (place.measured, *place.simulated) if measure == "nearest_m" else (place.measured,)
    return any(np.isfinite(getattr(each, measure)).any() for each in curves)


def _draw(axes: Axes, place: CrowdPlace, measure: str) -> None:
    if not _is_drawn(place, measure):
        axes.set_axis_off()
        return
    measured = place.measured
    values = getattr(measured, measure)
    axes.plot(measured.density_pm2, values, color=style.INK, linewidth=2.0, label="measured")
    if measure == "speed_mps":
        band = measured.speed_deviation_mps
        axes.fill_between(
            measured.density_pm2, values - band, values + band, color=style.INK, alpha=0.12, lw=0
        )
    for curve, look in zip(place.simulated, _LOOKS, strict=False):
        label, values = curve.name.replace("_", " "), getattr(curve, measure)
        axes.plot(curve.density_pm2, values, label=label, **look.arguments)
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.grid()
