"""The figure of the table: what each method loses on each task, and what its intervals hold."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.bench.measure import METHODS
from lab.bench.page import COVERAGES, SCORES
from serd_app.report import style
from serd_app.report.style import BLUE, CYAN, GREEN, INK, MUTED, PURPLE, RED, YELLOW
from serd_core import plots

LOOKS = tuple(zip((BLUE, RED, PURPLE, GREEN, YELLOW, CYAN, INK, MUTED), "o^sDXvPh", strict=True))
#: Losses below this are drawn here.
LEAST = 1e-4
TITLES = {
    "log-likelihood": "loss of log-likelihood [nats]",
    "transfer": "the same in transfer [nats]",
    "divergence": "divergence of the moves [nats]",
    "coverage of weights": "weights within 90 % intervals",
    "coverage of probabilities": "probabilities within them",
}


def bench_figure(table: pd.DataFrame) -> Figure:
    """A panel per measure, a place per task and size, a mark per method; less loss is better."""
    places = list(dict.fromkeys(zip(table["task"], table["demonstrations"], strict=True)))
    with style.report_style():
        figure = style.new_figure(11.0, 11.0)
        panels = figure.subplots(len(TITLES), 1, sharex=True)
        for axes, (name, title) in zip(panels, TITLES.items(), strict=True):
            _draw(axes, table, name, places)
            axes.set_title(title, loc="left")
            axes.grid(axis="y")
        names = [f"{task}, {size}" for task, size in places]
        panels[-1].set_xticks(range(len(places)), names, rotation=45, ha="right")
        handles = panels[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=4)
    return figure


def _draw(axes: Axes, table: pd.DataFrame, name: str, places: list[tuple[str, int]]) -> None:
    for number, (method, (colour, marker)) in enumerate(zip(METHODS.values(), LOOKS, strict=False)):
        here = table[table["method"] == method.title]
        if name not in here or not len(here):
            continue
        pairs = zip(here["task"], here["demonstrations"], strict=True)
        at = np.array([places.index(pair) for pair in pairs]) + (number - 3.5) / 10
        value, half = here[name].to_numpy(), here[f"{name} ±"].fillna(0.0).to_numpy()
        value = -value if SCORES.get(name) == 1 else value
        ends = np.stack([value - half, value, value + half])
        ends = np.clip(ends, 0.0, 1.0) if name in COVERAGES else np.maximum(ends, LEAST)
        look = {"fmt": marker, "color": colour, "markersize": 4.5, "elinewidth": 1.0}
        plots.intervals(at, ends, axes, **look, label=method.title)
    for place in range(1, len(places)):
        axes.axvline(place - 0.5, color=style.HAIRLINE, linewidth=0.7)
    if name in COVERAGES:
        axes.axhline(0.9, color=INK, linestyle=":", linewidth=1.0)
    else:
        axes.set_yscale("log")
