"""Fig. 5.10: predicted and measured distribution of the time of arrival, method by method."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.experts import PEOPLE
from lab.experiments.study.study import Study
from lab.learner_curves import STYLES
from serd_app.report import style
from serd_app.report.figures.arrival import ArrivalCurve, draw_curve
from serd_app.report.style import Look, new_figure
from serd_core.arrays import FloatArray, IntArray
from serd_core.arrival.bands import clopper_pearson, sampling_band

_MARKS = 21
#: Nearly all arrive within these times; a line of text has what holds at the end.
_FROM_S, _TO_S = 40.0, 120.0


def rows(results: Results) -> pd.DataFrame:
    """Both CDFs by whole periods, with pointwise bands, and that of sampled trajectories."""
    coverage = results.settings.statistics.coverage
    curves = []
    for method in results.methods(PEOPLE):
        tables = results.arrival_tables(PEOPLE, method)
        n_episodes = tables.n_episodes * len(tables.measured)
        predicted, measured = tables.predicted.mean(axis=0), tables.measured.mean(axis=0)
        sampled = np.mean(
            [each["sampled_cdf"] for each in results.predictions(PEOPLE, method)], axis=0
        )
        around = sampling_band(predicted, n_episodes, coverage)
        exact = clopper_pearson(np.round(measured * n_episodes), n_episodes, coverage)
        columns = {
            "method": method,
            "n_episodes": n_episodes,
            "time_s": tables.period_s * np.arange(len(predicted)),
            "predicted": predicted,
            "predicted_lower": around[0],
            "predicted_upper": around[1],
            "sampled": sampled,
            "measured": measured,
            "measured_lower": exact[0],
            "measured_upper": exact[1],
        }
        curves.append(pd.DataFrame(columns))
    return pd.concat(curves)


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """All measured curves, then one panel per method."""
    del study
    curves = dict(iter(table.groupby("method", sort=False)))
    with style.report_style():
        figure = new_figure(12.0, 6.4)
        panels = figure.subplots(2, (len(curves) + 2) // 2, sharey=True).ravel()
        for number, (method, curve) in enumerate(curves.items()):
            # Curves that lie on each other have their markers at different times.
            look = STYLES[method].arguments | {"markevery": (number, len(curves)), "markersize": 4}
            panels[0].step(curve["time_s"], curve["measured"], where="post", label=method, **look)
        panels[0].set_title("measured, all methods", loc="left")
        for axes, (method, curve) in zip(panels[1:], curves.items(), strict=False):
            _compare(axes, curve)
            axes.set_title(method, loc="left")
        for axes in panels[: len(curves) + 1]:
            axes.set(xlim=(_FROM_S, _TO_S), ylim=(0, 1.03))
            axes.tick_params(labelbottom=True)
            axes.grid()
            axes.set_xlabel("time since the start in s")
        for spare in panels[len(curves) + 1 :]:
            spare.set_axis_off()
        panels[1].legend(fontsize=7)
        shown, title = panels[0].get_legend_handles_labels(), "measured, all methods"
        figure.legend(*shown, loc="outside lower center", ncols=len(curves), title=title)
        figure.supylabel("probability of having arrived", fontsize=9)
    return figure


def _compare(axes: Axes, curve: pd.DataFrame) -> None:
    for kind in ("predicted", "measured"):
        names = ["time_s", kind, f"{kind}_lower", f"{kind}_upper"]
        draw_curve(axes, ArrivalCurve(*curve[names].to_numpy().T), kind, kind)
    end = curve.iloc[-1]
    at_end = f"predicted {end['predicted']:.2f}, measured {end['measured']:.2f}"
    text = f"at {end['time_s']:.0f} s: {at_end}"
    axes.text(0.98, 0.05, text, transform=axes.transAxes, ha="right", fontsize=7)
    shown = curve.iloc[_spread(curve["time_s"].to_numpy())]
    ring: Look = {"markerfacecolor": "none", "markeredgecolor": style.INK, "markersize": 3.5}
    ring |= {"markeredgewidth": 0.7, "label": "sampled trajectories"}
    axes.plot(shown["time_s"], shown["sampled"], "o", **ring)


def _spread(times_s: FloatArray) -> IntArray:
    """Indices of times that lie evenly on the axis, as far as possible."""
    wanted_s = np.linspace(_FROM_S, _TO_S, _MARKS)
    return np.unique(np.searchsorted(times_s, wanted_s - 1e-9).clip(max=len(times_s) - 1))
