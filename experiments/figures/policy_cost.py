"""Table 4.2 as measured: seconds against each size."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.policy_cost import STATED
from experiments.running.repetitions import Row
from report.style import BLUE, GREEN, PURPLE, RED, new_figure, report_style

COLOURS = dict(zip(STATED, (RED, BLUE, PURPLE, GREEN), strict=True))
LABELS = {"n_states": "states", "n_actions": "actions", "n_parameters": "parameters"}


def cost_figure(rows: Sequence[Row], exponents: Sequence[Row]) -> Figure:
    """One panel per ladder; the legend gives fitted and stated exponents."""
    with report_style():
        figure = new_figure(9.0, 4.4)
        panels = figure.subplots(1, 3, sharey=True)
        for axes, (varied, label) in zip(panels, LABELS.items(), strict=True):
            _draw_ladder(axes, varied, rows, exponents)
            axes.set_xlabel(label)
        panels[0].set_ylabel("seconds")
    return figure


def _draw_ladder(axes: Axes, varied: str, rows: Sequence[Row], exponents: Sequence[Row]) -> None:
    for method, colour in COLOURS.items():
        chosen = [row for row in rows if row["method"] == method and row["varied"] == varied]
        (fit,) = (row for row in exponents if row["method"] == method and row["varied"] == varied)
        axes.loglog(
            [row[varied] for row in chosen],
            [row["seconds"] for row in chosen],
            "o-",
            color=colour,
            label=f"{method}: {fit['fitted']:.2f} ({fit['stated']})",
        )
    axes.grid(visible=True)
    tick_sizes(axes, sorted({row[varied] for row in rows if row["varied"] == varied}))
    title = "fitted exponent (stated)"
    axes.legend(title=title, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
