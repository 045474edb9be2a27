"""Which assumption about an expert's belief pays when: experts who know and experts who err.

Differences to MDCE IRL, which takes the M-estimate for both belief and truth, within repetitions.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.running.repetitions import Row
from experiments.study.figures.context import FigureContext
from experiments.study.figures.looks import ASSUMPTION_LOOKS, EXPERT_TITLES
from experiments.study.fits.methods import BASELINE
from experiments.study.tables.catalogue import beliefs
from experiments.study.tables.results import Results
from report import style
from report.style import new_figure

ROWS = {
    "test_log_likelihood": "test log-likelihood\n(higher is better)",
    "transfer_log_likelihood": "transfer log-likelihood\n(higher is better)",
    "dynamics_divergence": "divergence of the dynamics\n(lower is better)",
}


def rows(results: Results) -> list[Row]:
    """Means and differences to the baseline with intervals."""
    return beliefs(results)


def draw(table: list[Row], context: FigureContext) -> Figure:
    """A column per expert, a row per measure, a curve per assumption; zero is the baseline."""
    del context
    with style.report_style():
        figure = new_figure(11.0, 7.6)
        panels = figure.subplots(len(ROWS), len(EXPERT_TITLES), sharex=True, sharey="row")
        for line, (measure, label) in zip(panels, ROWS.items(), strict=True):
            for axes, (expert, title) in zip(line, EXPERT_TITLES.items(), strict=True):
                chosen = [
                    row for row in table if (row["measure"], row["expert"]) == (measure, expert)
                ]
                _panel(axes, chosen)
                if measure == next(iter(ROWS)):
                    axes.set_title(f"the expert {title}")
            line[0].set_ylabel(label)
            line[0].set_ylim(*_limits([row for row in table if row["measure"] == measure]))
        figure.supxlabel("demonstrations", fontsize=9)
        figure.legend(
            *panels[0, 0].get_legend_handles_labels(),
            loc="outside upper center",
            ncols=len(ASSUMPTION_LOOKS),
            title="difference to IRL under the M-estimate (mean, 95 % interval) when the belief is",
        )
    return figure


def _panel(axes: Axes, rows: list[Row]) -> None:
    axes.axhline(0.0, color=ASSUMPTION_LOOKS[BASELINE].colour, linewidth=1.0, linestyle="--")
    sizes = sorted({int(row["size"]) for row in rows})
    for place, (assumption, look) in enumerate(ASSUMPTION_LOOKS.items()):
        if assumption == BASELINE:
            continue
        curve = [row for row in rows if row["assumption"] == assumption]
        middle, low, high = (
            np.array([float(row[name]) for row in curve])
            for name in ("difference", "difference_lower", "difference_upper")
        )
        # Side by side, so that intervals do not cover each other.
        shifted = [size * 1.05 ** (place - 2.5) for size in sizes]
        axes.errorbar(
            shifted,
            middle,
            yerr=[middle - low, high - middle],
            color=look.colour,
            marker=look.marker,
            linestyle=look.line,
            markersize=5,
            linewidth=1.3,
            elinewidth=1.0,
            label=assumption,
        )
    axes.set_xscale("log")
    axes.grid(axis="y")
    tick_sizes(axes, sizes)


def _limits(rows: list[Row]) -> tuple[float, float]:
    """Limits that show the larger half of the sizes; with fewer demonstrations much is far off."""
    sizes = sorted({int(row["size"]) for row in rows})
    shown = [row for row in rows if int(row["size"]) >= sizes[len(sizes) // 2]]
    low = min(float(row["difference_lower"]) for row in shown)
    high = max(float(row["difference_upper"]) for row in shown)
    margin = 0.08 * (high - low) + 1e-6
    return low - margin, high + margin
