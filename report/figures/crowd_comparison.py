"""Simulated and measured crowds: speed over density, and passing distance."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from report import style
from report.style import new_figure
from serd_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class CrowdCurve:
    """(D,) mean speed and median passing distance at each density; NaN where not measured."""

    name: str
    density_pm2: FloatArray
    speed_mps: FloatArray
    passing_distance_m: FloatArray


_LOOKS = ((style.BLUE, "o", "-"), (style.PURPLE, "s", "--"), (style.YELLOW, "^", ":"))


def draw_crowd_comparison(
    one_way: Sequence[CrowdCurve],
    weidmann: CrowdCurve,
    two_way: Sequence[CrowdCurve],
    recorded: CrowdCurve | None,
) -> Figure:
    """Left: one-way speed against Weidmann. With a recording, speed and distance of two ways."""
    with style.report_style():
        figure = new_figure(10.2 if recorded else 4.0, 3.5)
        panels = figure.subplots(1, 3 if recorded else 1, squeeze=False)[0]
        axes = panels[0]
        axes.plot(weidmann.density_pm2, weidmann.speed_mps, color=style.INK, label=weidmann.name)
        _draw(axes, one_way, "speed_mps")
        _finish(axes, "one way", "mean speed along the corridor, m/s")
        if recorded is not None:
            for axes, measure, title, label in (
                (panels[1], "speed_mps", "two ways: speed", "mean speed, m/s"),
                (
                    panels[2],
                    "passing_distance_m",
                    "two ways: passing distance",
                    "median distance to the nearest\noncoming person, m",
                ),
            ):
                values = getattr(recorded, measure)
                axes.plot(recorded.density_pm2, values, "D-", color=style.INK, label=recorded.name)
                _draw(axes, two_way, measure)
                _finish(axes, title, label)
    return figure


def _draw(axes: Axes, curves: Sequence[CrowdCurve], measure: str) -> None:
    for curve, (colour, marker, line) in zip(curves, _LOOKS, strict=False):
        axes.plot(
            curve.density_pm2,
            getattr(curve, measure),
            color=colour,
            marker=marker,
            linestyle=line,
            label=curve.name,
        )


def _finish(axes: Axes, title: str, label: str) -> None:
    axes.set(title=title, xlabel="people per m²", ylabel=label, xlim=(0, None), ylim=(0, None))
    axes.grid()
    axes.legend(loc="lower left")
