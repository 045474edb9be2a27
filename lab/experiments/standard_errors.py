"""Standard errors where the expert is not the one that is assumed, against Monte Carlo.

Demonstrations of one world are drawn again and again, and SERD learns from each. The standard
deviation of its estimates is what a standard error should be: by Laplace (inverse Hessian), and by
the sandwich with scores summed by decision (White 1982) or by episode (Liang and Zeger 1986).
"""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd

import serd_core as sc
from lab.bench.worlds import N_STEPS, World, confounded_world, grid_world
from lab.experiments.running.experiment import Count, Findings, SeededConfig, Session, Sizes
from lab.experiments.running.tables import Row
from serd_core.arrays import FloatArray
from serd_files.settings import setting

WORLDS = {"gridworld with borders": grid_world, "confounded": confounded_world}
PRIOR = sc.PriorByEvidence(deviation=3.0, pseudo_count=1.0)
ERRORS = ("Laplace", "sandwich", "sandwich by episode")
GREEDY, TEMPERATURE, OTHER_DISCOUNT = 0.9, 0.5, 0.8
#: Half width of a normal 90 % interval in standard errors.
HALF_90 = 1.6448536


class StandardErrorsConfig(SeededConfig):
    """How many data sets, and how large."""

    n_repetitions: Count = setting(200, "data sets of each world, expert and size")
    sizes: Sizes = setting((25, 100), "demonstrations of a data set")


def run_standard_errors(config: StandardErrorsConfig, session: Session) -> Findings:
    """Mean standard errors over the standard deviation of estimates, and coverage."""
    table = session.repeat(partial(estimates, config), config.n_repetitions, config)
    summary = summary_of(table)
    return Findings(summary, {"estimates.csv": table, "summary.csv": summary})


def experts(world: World) -> dict[str, FloatArray]:
    """(S, A) policies by name, of which the first is the one that learners assume."""
    plain, given = world.problem, (world.problem, world.weights, world.truth)
    best = sc.optimal_policy(*given).probabilities
    short = sc.Mdp(plain.mdp.transitions, OTHER_DISCOUNT)
    other = sc.TabularProblem(short, plain.features, plain.feature_names)
    return {
        "as assumed": world.policy(plain),
        "greedy but for a tenth": GREEDY * best + (1.0 - GREEDY) / best.shape[1],
        "Boltzmann over optimal Q": sc.boltzmann_policy(*given, TEMPERATURE).probabilities,
        f"discount {OTHER_DISCOUNT:g} for 0.95": sc.soft_policy(other, *given[1:]).probabilities,
    }


def estimates(config: StandardErrorsConfig, number: int) -> list[Row]:
    """A row per number that is estimated from one data set of each world, expert and size."""
    rows: list[Row] = []
    for place, (kind, family) in enumerate(WORLDS.items()):
        world = family(np.random.default_rng([config.seed, place]))
        for expert, policy in experts(world).items():
            for size in config.sizes:
                rng = np.random.default_rng([config.seed, place, size, number, 1])
                decisions = sc.sample_decisions(
                    world.problem.mdp, policy, world.truth, world.starts,
                    n_episodes=size, n_steps=N_STEPS, rng=rng,
                )  # fmt: skip
                about = {"world": kind, "expert": expert, "demonstrations": size}
                rows += [about | row for row in _of_fit(world.problem, decisions)]
    return rows


def _of_fit(problem: sc.TabularProblem, decisions: sc.Decisions) -> list[Row]:
    fit = sc.fit_mdce_serd(problem, decisions, prior=PRIOR)
    information = sc.fit_information(problem, decisions, fit)
    by_episode = sc.clustered_outer_product(problem, information, decisions)
    meats = (None, information.outer_product, by_episode)
    found = [sc.standard_errors(problem, information, meat=meat) for meat in meats]
    parts: tuple[tuple[str, FloatArray, list[Any]], ...] = (
        ("weight", fit.reward_weights, [each.reward for each in found]),
        ("probability", fit.outcome_probabilities, [each.outcome_probabilities for each in found]),
    )
    return [
        {"kind": kind, "number": number, "estimate": float(value)}
        | {name: float(each.ravel()[number]) for name, each in zip(ERRORS, errors, strict=True)}
        for kind, values, errors in parts
        for number, value in enumerate(values.ravel())
    ]


def summary_of(table: pd.DataFrame) -> pd.DataFrame:
    """By world, expert, size and kind: standard errors over the true one, and coverage.

    The true one is the standard deviation of the estimates; intervals of 90 % should hold their
    mean, which is what misspecified estimators converge to. Medians and means over the numbers.
    """
    keys = ["world", "expert", "demonstrations", "kind"]
    rows = []
    for place, here in table.groupby(keys, sort=False):
        row: Row = dict(zip(keys, place, strict=True))
        shape = -1, here["number"].nunique()
        drawn = here["estimate"].to_numpy().reshape(shape)
        true, mean = drawn.std(axis=0, ddof=1), drawn.mean(axis=0)
        row |= {"numbers": shape[1], "data sets": len(drawn), "sd": float(np.median(true))}
        for name in ERRORS:
            errors = here[name].to_numpy().reshape(shape)
            typical = np.sqrt(np.mean(errors**2, axis=0))
            row[f"{name} / sd"] = float(np.median(typical / true))
            row[f"{name}: held"] = float(np.mean(np.abs(drawn - mean) <= HALF_90 * errors))
        rows.append(row)
    return pd.DataFrame(rows)
