"""Simulation-based calibration of swept draws: 500 data sets in each of seven kinds of worlds.

    python -m lab calibration
    python -m lab calibration --data-sets 50

It goes on where it was stopped. The prior of a fit is that of its family. A family is rejected
where the least p-value of its n numbers is below 0.05 / n. Intervals that have not mixed have no
rank.
"""

from typing import Annotated

import numpy as np
import scipy.stats
import typer
from matplotlib.figure import Figure

from lab import RESULTS
from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import N_RANKED, calibration_ranks, uniformity
from lab.posterior.families import FAMILIES
from serd_app.report.style import BLUE, MUTED, new_figure, save_figure
from serd_core.arrays import IntArray
from serd_core.errors import SerdError

N_DATA_SETS = 500
DataSets = Annotated[int, typer.Option("--data-sets", help="data sets per kind of world")]


def run(n_data_sets: DataSets = N_DATA_SETS) -> None:
    """Rank the truth in the data sets that are missing."""
    cases = [
        {"family": family, "data_set": number}
        for number in range(n_data_sets)
        for family in FAMILIES
    ]
    measured = measured_rows("calibration", cases, measure)
    rows, of_families = [], {}
    for family in FAMILIES:
        found = [row for row in measured if row["family"] == family]
        ranks = np.array([row["ranks"] for row in found if row["ranks"]])
        of_families[family] = ranks
        p_values = uniformity(ranks)
        failures = sorted({row["failure"] for row in found} - {""})
        rows.append(
            {"family": family, "data sets": len(found), "numbers": len(p_values)}
            | {"not drawn": sum(not row["ranks"] for row in found)}
            | {"not mixed": float((ranks < 0).mean())}
            | {"least p": float(p_values.min()), "level": 0.05 / len(p_values)}
            | {"why not drawn": "; ".join(failures)[:200]}
        )
    save("calibration", "Simulation-based calibration", rows)
    save_figure(RESULTS / "calibration.png", _figure(of_families))


def _figure(of_families: dict[str, IntArray]) -> Figure:
    """Share of ranks up to each one less the share expected, with its central 95 % by chance."""
    figure = new_figure(9.0, 4.6)
    axes = figure.subplots(2, 4, sharex=True, sharey=True)
    expected = np.arange(1, N_RANKED + 2) / (N_RANKED + 1)
    for ax, (family, ranks) in zip(axes.flat, of_families.items(), strict=False):
        n = len(ranks)
        band = scipy.stats.binom.ppf([[0.025], [0.975]], n, expected) / n - expected
        ax.fill_between(expected, *band, color=MUTED, alpha=0.3, linewidth=0)
        for column in ranks.T:
            ranked = np.bincount(column[column >= 0], minlength=N_RANKED + 1)
            share = np.cumsum(ranked) / max(ranked.sum(), 1)
            ax.plot(expected, share - expected, color=BLUE, linewidth=0.7, alpha=0.6)
        ax.set_title(f"{family}, {n} sets", fontsize=8)
    for ax in axes.flat[len(of_families) :]:
        ax.axis("off")
    figure.supxlabel("rank of the truth among draws, as a share", fontsize=9)
    figure.supylabel("share of data sets, less the expected one", fontsize=9)
    return figure


def measure(family: str, data_set: int) -> dict[str, object]:
    """Ranks of the truth in one data set; none, and why, where there is no posterior to draw."""
    rng = np.random.default_rng([1, data_set])
    try:
        ranks = calibration_ranks(FAMILIES[family](), rng)
    except SerdError as error:
        return {"ranks": [], "failure": str(error)}
    return {"ranks": ranks.tolist(), "failure": ""}
