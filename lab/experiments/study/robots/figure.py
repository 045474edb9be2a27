"""The figure of the study of four robots: who has arrived by when, in both tasks."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.study.robots.settings import TASKS
from serd_app.report import style
from serd_app.report.style import new_figure

#: Label, colour and line of each robot that is drawn.
LOOKS = {
    "serd": ("SERD", style.BLUE, "-"),
    "irl": ("IRL, counted dynamics, same prior", style.PURPLE, "--"),
    "shortest": ("no model, shortest way", style.YELLOW, "-."),
    "goal": ("planner with the goal alone", style.MUTED, ":"),
}
_TITLES = {
    "train": "Against the stream is short, but slow",
    "transfer": "Against the stream is right",
}


def robots_figure(drives: pd.DataFrame) -> Figure:
    """One panel per task of the first place: share of drives that have arrived by each second."""
    place = drives["place"].iloc[0]
    with style.report_style():
        figure = new_figure(9.0, 3.9)
        for axes, task in zip(figure.subplots(1, 2, sharey=True), TASKS, strict=True):
            chosen = drives[(drives["place"] == place) & (drives["task"] == task)]
            _draw_arrivals(axes, chosen)
            axes.set_title(_TITLES[task], loc="left")
        figure.axes[0].set_ylabel("share of drives that have arrived")
        figure.axes[0].legend(loc="lower right")
    return figure


def _draw_arrivals(axes: Axes, drives: pd.DataFrame) -> None:
    end_s = float(drives["seconds"].max())
    for name, (label, colour, line) in LOOKS.items():
        own = drives[drives["robot"] == name]
        if own.empty:
            continue
        times_s = np.sort(own.loc[own["arrived"], "seconds"].to_numpy(np.float64))
        share = np.arange(len(times_s) + 1) / len(own)
        mean_s = own["seconds"].mean()
        axes.step(
            np.concatenate([[0.0], times_s, [end_s]]),
            np.append(share, share[-1]),
            where="post",
            color=colour,
            linestyle=line,
            label=label,
        )
        axes.plot(mean_s, 0.02, "^", color=colour, markersize=8, markeredgecolor="white", zorder=5)
    axes.set(xlim=(0, end_s), ylim=(0, 1.02), xlabel="seconds (triangle: mean)")
    axes.grid()
