"""Assumptions about an expert's belief compared, for experts with a right and a wrong belief.

Differences to MDCE IRL, which takes the M-estimate for both belief and truth, within repetitions.
"""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.experiments.study.fits.methods import ASSUMPTIONS, BASELINE
from lab.experiments.study.hallway.tables.catalogue import beliefs
from lab.experiments.study.hallway.tables.results import Results
from lab.experiments.study.recordings.experts import EXPERT_NAMES
from lab.experiments.study.study import Study
from lab.learner_curves import STYLES, draw_intervals, tick_sizes
from serd_app.report import style
from serd_app.report.style import new_figure

ROWS = {
    "test_log_likelihood": "test log-likelihood\n(higher is better)",
    "transfer_log_likelihood": "transfer log-likelihood\n(higher is better)",
    "dynamics_divergence": "divergence of the dynamics\n(lower is better)",
}
_VALUES = ["difference_lower", "difference", "difference_upper"]


def rows(results: Results) -> pd.DataFrame:
    """Means and differences to the baseline with intervals."""
    return beliefs(results)


def draw(table: pd.DataFrame, study: Study) -> Figure:
    """A column per expert, a row per measure, a curve per assumption; zero is the baseline."""
    del study
    experts = table["expert"].unique()
    with style.report_style():
        figure = new_figure(11.0, 7.6)
        panels = figure.subplots(len(ROWS), len(experts), sharex=True, sharey="row")
        for line, (measure, label) in zip(panels, ROWS.items(), strict=True):
            measured = table[table["measure"] == measure]
            for axes, expert in zip(line, experts, strict=True):
                _panel(axes, measured[measured["expert"] == expert])
            line[0].set_ylabel(label)
            line[0].set_ylim(*_limits(measured))
        for axes, expert in zip(panels[0], experts, strict=True):
            axes.set_title(f"the expert {EXPERT_NAMES[expert]}")
        figure.supxlabel("demonstrations", fontsize=9)
        figure.legend(
            *panels[0, 0].get_legend_handles_labels(),
            loc="outside upper center",
            ncols=len(ASSUMPTIONS),
            title="difference to IRL under the M-estimate (mean, 95 % interval) when the belief is",
        )
    return figure


def _panel(axes: Axes, table: pd.DataFrame) -> None:
    axes.axhline(0.0, color=STYLES[BASELINE].colour, linewidth=1.0, linestyle="--")
    for place, (assumption, curve) in enumerate(table.groupby("assumption", sort=False)):
        if assumption != BASELINE:
            draw_intervals(
                axes, curve["size"], curve[_VALUES].to_numpy().T, assumption, place - 2.5
            )
    axes.set_xscale("log")
    axes.grid(axis="y")
    tick_sizes(axes, sorted(table["size"].unique()))


def _limits(table: pd.DataFrame) -> tuple[float, float]:
    """Limits that show the larger half of the sizes; with fewer demonstrations much is far off."""
    sizes = sorted(table["size"].unique())
    shown = table[table["size"] >= sizes[len(sizes) // 2]]
    low, high = shown["difference_lower"].min(), shown["difference_upper"].max()
    margin = 0.08 * (high - low) + 1e-6
    return low - margin, high + margin
