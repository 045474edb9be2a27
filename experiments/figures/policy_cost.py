"""Table 4.2 as measured: seconds against each size."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from experiments.figures.ticks import tick_sizes
from experiments.policy_cost import STATED
from experiments.repetitions import Row
from report.canvas import new_figure
from report.style import BLUE, GREEN, HAIRLINE, PURPLE, RED

COLOURS = dict(zip(STATED, (RED, BLUE, PURPLE, GREEN), strict=True))
LABELS = {"n_states": "states", "n_actions": "actions", "n_parameters": "parameters"}


def cost_figure(rows: Sequence[Row], exponents: Sequence[Row]) -> Figure:
    """One panel per ladder; the legend gives fitted and stated exponents."""
    figure = new_figure(10.0, 4.2)
    for axes, (varied, label) in zip(figure.subplots(1, 3), LABELS.items(), strict=True):
        for method, colour in COLOURS.items():
            chosen = [row for row in rows if row["method"] == method and row["varied"] == varied]
            (fit,) = (
                row for row in exponents if row["method"] == method and row["varied"] == varied
            )
            axes.loglog(
                [row[varied] for row in chosen],
                [row["seconds"] for row in chosen],
                "o-",
                color=colour,
                label=f"{method}: {fit['fitted']:.2f} ({fit['stated']})",
            )
        axes.set(xlabel=label, ylabel="seconds")
        axes.grid(color=HAIRLINE, linewidth=0.6)
        tick_sizes(axes, sorted({row[varied] for row in rows if row["varied"] == varied}))
        axes.legend(
            title="fitted exponent (stated)",
            fontsize="small",
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=2,
            frameon=False,
        )
    return figure
