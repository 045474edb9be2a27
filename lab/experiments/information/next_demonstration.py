"""What choosing the next demonstration saves: starts of most expected information against random.

The populated hallway as a decision problem with measured dynamics. Both arms begin with the same
demonstration from a random cell; each further one starts where the expected information gain of the
present posterior is largest, or in a random cell. Both are tested on decisions from random cells.
"""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lab.experiments.information.avoidance import AvoidanceConfig, hallway, measured_dynamics
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session
from lab.experiments.running.statistics import StatisticsSettings, mean_interval, paired_p_value
from lab.experiments.running.tables import Row
from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_app.report import style
from serd_app.report.style import new_figure
from serd_core.arrays import FloatArray
from serd_core.bayes.information import expected_information_gain
from serd_core.bayes.laplace import laplace
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.grid.navigation import FEATURE_NAMES, NavigationProblem
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.policies.solved_policy import soft_policy
from serd_core.selection.evaluation import fitted_policy, policy_log_likelihood
from serd_files.settings import setting

CHOSEN, RANDOM = "chosen", "random"
_TICKS = (0.02, 0.05, 0.1, 0.2, 0.5)
_STATISTICS = StatisticsSettings(bootstrap=2000, coverage=0.95)


class NextDemonstrationConfig(SeededConfig):
    """Experts with a social norm in the gridded hallway."""

    n_repetitions: Count = setting(40, "pairs of arms")
    most: Count = setting(6, "demonstrations of an arm")
    longest: Count = setting(60, "decisions of a demonstration")
    test_episodes: Count = setting(100, "episodes of the test set")
    shortfall: float = setting(
        0.1, "log-likelihood per decision below the expert's own that is good enough", gt=0
    )


def run_next_demonstration(config: NextDemonstrationConfig, session: Session) -> Findings:
    """Shortfall of the likelihood after each demonstration, and how many reach the wanted one."""
    table = session.repeat(partial(compare_arms, config), config.n_repetitions, config)
    summary = summary_of(table, config)
    files = {
        "shortfalls.csv": table,
        "summary.csv": summary,
        "needed.csv": needed_table(table, config),
        "next_demonstration.png": shortfall_figure(summary, config),
    }
    return Findings(summary, files)


def compare_arms(config: NextDemonstrationConfig, number: int) -> list[Row]:
    """Rows of both arms of one repetition."""
    world = AvoidanceConfig()
    problem, truth = hallway(world, FEATURE_NAMES), measured_dynamics()
    policy = soft_policy(problem, world.weights(FEATURE_NAMES), truth).probabilities
    free = (~problem.mdp.final).astype(np.float64)
    sample = partial(sample_decisions, problem.mdp, policy, truth, n_steps=config.longest)
    rng = np.random.default_rng([config.seed, number])
    test = sample(free / free.sum(), n_episodes=config.test_episodes, rng=rng)
    own = policy_log_likelihood(problem, test, policy)
    first = int(rng.choice(np.flatnonzero(free)))
    rows: list[Row] = []
    for arm in (CHOSEN, RANDOM):
        # The same random numbers for both arms, so that the first demonstration is the same.
        drawn = np.random.default_rng([config.seed, number, 1])
        start = first
        seen: tuple[Decisions, ...] = ()
        for size in range(1, config.most + 1):
            one = sample(np.eye(len(free))[start], n_episodes=1, rng=drawn)
            seen = (*seen, one)
            decisions = concatenate_renumbered(seen)
            fit = fit_mdce_serd(problem, decisions)
            found = policy_log_likelihood(problem, test, fitted_policy(problem, fit))
            place: Row = {"repetition": number, "arm": arm, "size": size, "start": start}
            rows.append(
                place
                | {
                    "decisions": len(decisions),
                    "shortfall": own - found,
                    "converged": fit.converged,
                }
            )
            start = next_start(problem, decisions, fit, free, arm, drawn, config.longest)
    return rows


def next_start(
    problem: NavigationProblem,
    decisions: Decisions,
    fit: FitResult,
    free: FloatArray,
    arm: str,
    rng: np.random.Generator,
    longest: int,
) -> int:
    """The cell of the next demonstration; random where the fit has no posterior."""
    random = int(rng.choice(np.flatnonzero(free)))
    if arm == RANDOM or not fit.converged:
        return random
    return int(
        np.argmax(expected_information_gain(laplace(problem, decisions, fit), longest=longest))
    )


def summary_of(table: pd.DataFrame, config: NextDemonstrationConfig) -> pd.DataFrame:
    """Per size and arm: mean shortfall with interval, and the p-value of the paired difference."""
    rng = np.random.default_rng([config.seed, 2])
    rows: list[Row] = []
    for size, chosen in table.groupby("size"):
        values = chosen.pivot(index="repetition", columns="arm", values="shortfall")
        decisions = chosen.groupby("arm")["decisions"].mean()
        p = paired_p_value(values[CHOSEN].to_numpy(), values[RANDOM].to_numpy(), rng)
        for arm in (CHOSEN, RANDOM):
            found = mean_interval(values[arm].to_numpy(), _STATISTICS, rng)
            rows.append(
                {
                    "size": size,
                    "arm": arm,
                    **found.columns("shortfall"),
                    "median": float(values[arm].median()),
                    "decisions": float(decisions[arm]),
                    "p_value": p,
                }
            )
    return pd.DataFrame(rows)


def needed_table(table: pd.DataFrame, config: NextDemonstrationConfig) -> pd.DataFrame:
    """Demonstrations from which on the shortfall is small enough, `most` + 1 where never."""
    rows: list[Row] = []
    for (repetition, arm), run in table.groupby(["repetition", "arm"]):
        bad = run[run["shortfall"] > config.shortfall]["size"]
        needed = 1 if bad.empty else int(bad.max()) + 1
        rows.append({"repetition": repetition, "arm": arm, "needed": needed})
    return pd.DataFrame(rows)


def shortfall_figure(summary: pd.DataFrame, config: NextDemonstrationConfig) -> Figure:
    """Mean shortfall over the number of demonstrations, by arm."""
    with style.report_style():
        figure = new_figure(5.6, 3.8)
        axes = figure.subplots()
        for arm, colour, line in ((CHOSEN, style.BLUE, "-o"), (RANDOM, style.PURPLE, "--s")):
            rows = summary[summary["arm"] == arm]
            label = f"{arm} starts"
            axes.plot(rows["size"], rows["shortfall"], line, color=colour, label=label)
            axes.fill_between(
                rows["size"], rows["lower"], rows["upper"], color=colour, alpha=0.18, linewidth=0
            )
        axes.axhline(config.shortfall, color=style.GREEN, linewidth=1.0, label="good enough")
        axes.set(xlabel="demonstrations", yscale="log")
        axes.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        axes.minorticks_off()
        axes.set_ylabel("log-likelihood per decision below the expert's own")
        axes.grid(axis="y")
        axes.legend()
    return figure
