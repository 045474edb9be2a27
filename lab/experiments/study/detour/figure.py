"""The figure of the detour study: likelihood, dynamics, arrival, and the decoy."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.running.statistics import mean_interval
from lab.experiments.study.detour.arrival import DRIVEN
from lab.experiments.study.detour.fits import COUNTED, INFORMED, REWARDS, SERD
from lab.experiments.study.detour.settings import DetourStudy
from lab.experiments.study.detour.tables import BINS
from lab.learner_curves import LearnerStyle, tick_sizes
from serd_app.report import style
from serd_app.report.inputs import in_words
from serd_app.report.style import Look, draw_bars, new_figure
from serd_core.grid.grid import Outcome

LOOKS = {
    COUNTED: LearnerStyle(style.PURPLE, "s", "--"),
    SERD: LearnerStyle(style.BLUE, "o"),
    INFORMED: LearnerStyle(style.MUTED, "*", ":"),
}
_BIN_COLOURS = (style.RED, style.YELLOW, style.GREEN, style.CYAN)


def detour_figure(tables: Mapping[str, pd.DataFrame], study: DetourStudy) -> Figure:
    """Six panels: likelihood under two rewards, dynamics, arrival, decoy."""
    measures = tables["measures"]
    with style.report_style():
        figure = new_figure(12.0, 7.2)
        panels = figure.subplots(2, 3)
        for axes, (number, reward) in zip(panels[0], enumerate(REWARDS), strict=False):
            chosen = measures[measures["reward"] == reward]
            _draw_measure(axes, chosen, "transfer_log_likelihood", study)
            axes.set_title(f"({'ab'[number]}) transfer task, {reward}", loc="left")
            axes.set_ylabel("log-likelihood per decision")
        panels[0, 1].sharey(panels[0, 0])
        panels[0, 0].autoscale(axis="y")  # to the intervals of both
        own = measures[measures["reward"] == DRIVEN]
        _draw_measure(panels[0, 2], own[own["method"] != INFORMED], "forward_against", study)
        reference = tables["reference_dynamics"].set_index("model")
        truth = float(reference.loc["against_flow", Outcome.FORWARD.name.lower()])
        panels[0, 2].axhline(truth, color=style.GREEN, linestyle="--", label="measured truth")
        panels[0, 2].set_title("(c) learned dynamics", loc="left")
        panels[0, 2].set(ylabel="P(forward | against the flow)", ylim=(0, None))
        _draw_divergences(panels[1, 0], own, study)
        _draw_arrival(panels[1, 1], own)
        _draw_decoy(panels[1, 2], tables["decoy"], tables["decoy_summary"])
        panels[0, 0].legend(loc="lower left")
        panels[0, 2].legend(loc="lower right")
    return figure


def _draw_measure(axes: Axes, rows: pd.DataFrame, measure: str, study: DetourStudy) -> None:
    """Means with bootstrap intervals over the repetitions."""
    rng = np.random.default_rng([study.settings.seed, 2])
    sizes = sorted(rows["size"].unique())
    names = [name for name in LOOKS if name in set(rows["method"])]
    for place, name in enumerate(names):
        found = [
            mean_interval(
                rows[(rows["method"] == name) & (rows["size"] == size)][measure].to_numpy(),
                study.settings.statistics,
                rng,
            )
            for size in sizes
        ]
        ends = np.array([[each.lower, each.value, each.upper] for each in found]).T
        look = LOOKS[name].arguments | {"markersize": 5, "capsize": 2}
        draw_bars(axes, np.array(sizes) * 1.05 ** (place - 1), ends, **look, label=name)
    axes.set(xscale="log", xlabel="demonstrations")
    tick_sizes(axes, sizes)
    axes.grid(axis="y")


def _draw_divergences(axes: Axes, rows: pd.DataFrame, study: DetourStudy) -> None:
    """Divergence of each outcome model, all models alike, at the middle size."""
    sizes = sorted(rows["size"].unique())
    size = sizes[len(sizes) // 2]
    names = study.problem.model_names
    places = np.arange(len(names))
    for shift, method in ((-0.15, COUNTED), (0.15, SERD)):
        chosen = rows[(rows["method"] == method) & (rows["size"] == size)]
        values = chosen[[f"divergence_{name}" for name in names]].to_numpy()
        colour, marker = LOOKS[method].colour, LOOKS[method].marker
        for at, column in zip(places + shift, values.T, strict=True):
            beside = at + np.linspace(-0.05, 0.05, len(column))
            axes.plot(beside, np.sort(column), marker, color=colour, markersize=3, alpha=0.45)
            axes.plot([at - 0.12, at + 0.12], [column.mean()] * 2, color=colour, linewidth=2)
    axes.set_yscale("log")
    axes.set_xticks(places, [in_words(name) for name in names])
    axes.set_title(f"(d) outcome models, {size} demonstrations", loc="left")
    axes.set_ylabel("KLD, true from learned; bar: mean")
    axes.grid(axis="y")


def _draw_arrival(axes: Axes, rows: pd.DataFrame) -> None:
    """Median of predicted (open) and driven (filled) times, and every drive as a small mark."""
    sizes = sorted(rows["size"].unique())
    for place, (name, look) in enumerate(LOOKS.items()):
        chosen = rows[rows["method"] == name]
        at = np.arange(len(sizes)) + 0.24 * (place - 1)
        for x, size in zip(at, sizes, strict=True):
            own = chosen[chosen["size"] == size]
            driven = own["driven"].to_numpy(np.float64)
            spread = np.linspace(-0.05, 0.05, len(driven))
            axes.plot(x + spread, np.sort(driven), ".", color=look.colour, markersize=4, alpha=0.5)
            axes.plot(x, np.median(driven), look.marker, color=look.colour, markersize=7)
            predicted = own["predicted"].astype(float).fillna(np.inf).median()
            if np.isfinite(predicted):
                open_mark: Look = {"markerfacecolor": "none", "markersize": 10}
                axes.plot(x, predicted, look.marker, color=look.colour, **open_mark)
    for label, face in (("median driven", style.INK), ("median predicted", "none")):
        axes.plot([], [], "o", color=style.INK, markerfacecolor=face, label=label)
    axes.plot([], [], ".", color=style.INK, alpha=0.5, label="one drive")
    axes.legend(loc="upper right")
    axes.set_xticks(np.arange(len(sizes)), [str(size) for size in sizes])
    axes.set(xlabel="demonstrations", ylabel="seconds to the goal", ylim=(0, None))
    axes.set_title(f"(e) arrival, {DRIVEN}", loc="left")
    axes.grid(axis="y")


def _draw_decoy(axes: Axes, decoys: pd.DataFrame, summary: pd.DataFrame) -> None:
    """Medians of the posterior against the truth, by the number of moves seen."""
    axes.plot([0, 1], [0, 1], "--", color=style.GREEN, linewidth=1.2)
    for place, (name, colour) in enumerate(zip(BINS, _BIN_COLOURS, strict=True)):
        chosen = summary[summary["moves"] == name]
        if chosen.empty:
            continue
        shift = 0.018 * (place - 1.5)
        own = decoys[decoys["converged"] & decoys["moves"].between(*BINS[name])]
        axes.plot(own["truth"] + shift, own["median"], ".", color=colour, alpha=0.35)
        ends = chosen[["lower", "median", "upper"]].to_numpy().T
        look = {"color": colour, "marker": "osD^"[place], "markersize": 5, "linestyle": "none"}
        look |= {"capsize": 2, "label": f"{name} moves seen"}
        draw_bars(axes, chosen["truth"] + shift, ends, **look)
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel="true P(forward | against the flow)")
    axes.set_ylabel("posterior: median, 90 % interval")
    axes.set_title("(f) decoy: another truth", loc="left")
    axes.legend(loc="upper left")
    axes.grid()
