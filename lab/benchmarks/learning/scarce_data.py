"""How well learners do from few demonstrations, on worlds that are new each time.

    python -m lab scarce-data
    python -m lab scarce-data --worlds 20

It goes on where it was stopped. Measured in each world: the log-likelihood per decision less that
of the expert's own policy, weighted by the expert's visits, on the world and on another task with
the same rewards and dynamics; and the divergence of the learned outcome models from the true ones.
Compared in pairs with SERD's default: median difference, and the p-value of Wilcoxon's signed-rank
test. A learner that rules out what the expert does has a log-likelihood, and so a mean, of minus
infinity.
"""

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import scipy.stats
import typer

from lab.benchmarks.learning.fresh_worlds import FAMILIES, World
from lab.benchmarks.report import measured_rows, save
from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import laplace, laplace_draws, posterior_policy
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood
from serd_core.learners.serd import fit_mdce_serd
from serd_core.mdp.problem import TabularProblem
from serd_core.policies.solved_policy import soft_policy

SIZES = (1, 3, 6, 12, 25, 50)
MEASURES = ("log-likelihood", "transfer", "divergence")
SERD, IRL = "SERD", "IRL, counted dynamics"
N_WORLDS = 100
Worlds = Annotated[int, typer.Option("--worlds", help="worlds per size and family")]

Policy = Callable[[TabularProblem], FloatArray]


def run(n_worlds: Worlds = N_WORLDS) -> None:
    """Measure the worlds that are missing, then write the comparison."""
    cases = [
        {"family": family, "demonstrations": size, "world": number}
        for number in range(n_worlds)
        for family in FAMILIES
        for size in SIZES
    ]
    rows = measured_rows("scarce_data", cases, measure)
    save("scarce_data", "Learners from few demonstrations", comparison(rows))


def measure(family: str, demonstrations: int, world: int) -> dict[str, list[float]]:
    """The three measures of each learner in one world."""
    rng = np.random.default_rng([sorted(FAMILIES).index(family), demonstrations, world])
    fresh = FAMILIES[family](rng)
    return {
        name: scores(fresh, policy, table)
        for name, (policy, table) in learned(
            fresh, fresh.demonstrations(demonstrations, rng)
        ).items()
    }


def learned(world: World, decisions: Decisions) -> dict[str, tuple[Policy, FloatArray]]:
    """What each learner predicts, and its dynamics."""
    problem, by_evidence = world.problem, PriorByEvidence()
    counted = estimate_dynamics(problem, decisions)
    serd = fit_mdce_serd(problem, decisions)
    rng = np.random.default_rng(0)
    draws = laplace_draws(laplace(problem, decisions, serd), rng)
    irl = fit_mdce_irl_by_likelihood(problem, decisions, rng=rng)
    same = fit_mdce_irl_by_likelihood(problem, decisions, prior=by_evidence)

    def of(weights: FloatArray, table: FloatArray) -> tuple[Policy, FloatArray]:
        return (lambda task: soft_policy(task, weights, table).probabilities), table

    return {
        SERD: of(serd.reward_weights, serd.outcome_probabilities),
        "SERD, averaged": (
            lambda task: posterior_policy(task, draws),
            draws.outcome_probabilities.mean(axis=0),
        ),
        IRL: of(irl.reward_weights, counted),
        "IRL with SERD's prior": of(same.reward_weights, counted),
    }


def scores(world: World, policy: Policy, table: FloatArray) -> list[float]:
    """Both log-likelihoods and the divergence."""
    lost = [world.log_likelihood(task, policy(task)) for task in (world.problem, world.transfer)]
    divergence = np.sum(world.truth * np.log(world.truth / table), axis=1)
    return [*lost, float(np.mean(divergence))]


def comparison(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row per family, size, measure and learner."""
    table = []
    for family in FAMILIES:
        for size in SIZES:
            here = [r for r in rows if (r["family"], r["demonstrations"]) == (family, size)]
            for place, measured in enumerate(MEASURES):
                for name in (key for key in here[0] if isinstance(here[0][key], list)):
                    values, ours = ([r[key][place] for r in here] for key in (name, SERD))
                    table.append(
                        {"family": family, "demonstrations": size, "measure": measured}
                        | {"learner": name}
                        | summary(np.array(values), np.array(ours), place == len(MEASURES) - 1)
                    )
    return table


def summary(values: FloatArray, ours: FloatArray, lower_is_better: bool) -> dict[str, Any]:
    """Median, mean and tail of a learner, and by how much SERD is better in the median pair."""
    worst = 0.9 if lower_is_better else 0.1
    gain = (values - ours) if lower_is_better else (ours - values)
    p_value = float(scipy.stats.wilcoxon(gain).pvalue) if np.any(gain) else 1.0
    return {
        "worlds": len(values),
        "median": float(np.median(values)),
        "mean": float(np.mean(values)),
        "worst tenth": float(np.quantile(values, worst)),
        "SERD better by": float(np.median(gain)),
        "p": p_value,
    }
