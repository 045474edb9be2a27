"""Random starts and the number of distinct explanations they find (section 4.1).

Rewards and dynamics together can explain the same demonstrations in more than one way. On the
minimum example (section 4.6.1), SERD is fitted from several random weights to each demonstration
set; fits that converged to the same place count as one explanation.
"""

from functools import partial

import numpy as np
import pandas as pd

from lab.estimators.multi_start import MultiStart, multi_start
from lab.experiments.minimum_example.explanations import (
    ASCENT,
    MinimumExampleConfig,
    demonstrate,
    minimum_example,
    prior_of,
)
from lab.experiments.running.experiment import Count, Findings, Session, Sizes
from lab.experiments.running.tables import Row
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_files.settings import setting

KINDS = ("none", "1", "2", "3 or more")


class MultiStartConfig(MinimumExampleConfig):
    """Settings of the random starts on the minimum example."""

    n_sets: Count = setting(40, "demonstration sets of each size")
    sizes: Sizes = setting((1, 3, 12, 50), "demonstrations of a set")
    n_starts: Count = setting(10, "random starts for each set")


def run_multi_start(config: MultiStartConfig, session: Session) -> Findings:
    """Explanations of each set, and their shares."""
    n_all = config.n_sets * len(config.sizes)
    table = session.repeat(partial(explain_set, config), n_all, config)
    shares = explanation_shares(table)
    files = {
        "explanations.csv": table,
        "shares.csv": shares,
    }
    return Findings(shares, files)


def explain_set(config: MultiStartConfig, number: int) -> list[Row]:
    """The row of one demonstration set."""
    found = fits_of_set(config, number)
    best, *others = found.explanations or (None,)
    return [
        {
            "set": number,
            "size": config.sizes[number % len(config.sizes)],
            "n_converged": found.n_converged,
            "n_explanations": len(found.explanations),
            "objective": None if best is None else best.fit.objective,
            "starts_at_best": 0 if best is None else len(best.starts),
            "next_objective": others[0].fit.objective if others and others[0] else None,
        }
    ]


def fits_of_set(config: MultiStartConfig, number: int) -> MultiStart:
    """Sample the demonstration set of that number and fit it from every start."""
    rng = np.random.default_rng([config.seed, number])
    problem = minimum_example(config.discount)
    size = config.sizes[number % len(config.sizes)]
    decisions = demonstrate(problem, size, config.horizon, rng)

    def fit(start: np.random.Generator) -> FitResult:
        return fit_mdce_serd(problem, decisions, rng=start, prior=prior_of(config), ascent=ASCENT)

    return multi_start(fit, config.n_starts, rng)


def explanation_shares(table: pd.DataFrame) -> pd.DataFrame:
    """Per size: share of sets by number of distinct explanations, in columns as KINDS."""
    count = pd.cut(table["n_explanations"], [-1, 0, 1, 2, np.inf], labels=list(KINDS))
    return pd.crosstab(table["size"], count, normalize="index", dropna=False).reset_index()
