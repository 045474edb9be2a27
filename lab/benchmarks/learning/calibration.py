"""Simulation-based calibration of swept draws: 500 data sets in each of seven kinds of worlds.

    python -m lab calibration
    python -m lab calibration --data-sets 50

It goes on where it was stopped. The prior of a fit is that of its family. A family is rejected
where the least p-value of its n numbers is below 0.05 / n. Intervals that have not mixed have no
rank.
"""

from typing import Annotated

import numpy as np
import typer

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import calibration_ranks, uniformity
from lab.posterior.families import FAMILIES
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
    rows = []
    for family in FAMILIES:
        found = [row for row in measured if row["family"] == family]
        ranks = np.array([row["ranks"] for row in found if row["ranks"]])
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


def measure(family: str, data_set: int) -> dict[str, object]:
    """Ranks of the truth in one data set; none, and why, where there is no posterior to draw."""
    rng = np.random.default_rng([1, data_set])
    try:
        ranks = calibration_ranks(FAMILIES[family](), rng)
    except SerdError as error:
        return {"ranks": [], "failure": str(error)}
    return {"ranks": ranks.tolist(), "failure": ""}
