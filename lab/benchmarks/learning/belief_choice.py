"""Whether the evidence finds that an expert's belief is not the truth, and what its choice costs.

    python -m lab belief-choice
    python -m lab belief-choice --worlds 20

It goes on where it was stopped. In fresh worlds, whose experts know the dynamics or believe others:
the share in which tied is not the most probable relation, that in which another is decided on, and
the regret: the log-likelihood per decision of the expert's policy, of the better of tied and free
less that of the choice. Policies are averaged over the posterior, the choice over both relations
where it is undecided.
"""

from collections.abc import Callable
from itertools import product
from typing import Annotated, Any

import numpy as np
import typer

from lab.benchmarks.learning.fresh_worlds import World, grid_world, random_world, relative_world
from lab.benchmarks.report import measured_rows, save
from serd_core.arrays import FloatArray
from serd_core.bayes.belief_comparison import BeliefComparison, compare_beliefs
from serd_core.bayes.draws import laplace_draws, posterior_policy
from serd_core.posterior.beliefs import BeliefAroundTruth, FreeBelief, TiedBelief

SIZES = (25, 6)
#: With the first of the seeds of each: the first two have the same worlds.
FAMILIES: dict[str, tuple[int, Callable[..., World]]] = {
    "gridworlds": (0, grid_world),
    "gridworlds, relative outcomes": (0, relative_world),
    "random MDPs": (1, random_world),
}
EXPERTS = {"knows": False, "believes others": True}
N_WORLDS = 100
Worlds = Annotated[int, typer.Option("--worlds", help="worlds per size and family")]
#: First of the seeds; those of development have others.
SEED = 2026


def run(n_worlds: Worlds = N_WORLDS) -> None:
    """Measure the worlds that are missing, then write the table."""
    cases = [
        {"family": family, "expert": expert, "demonstrations": size, "world": number}
        for size in SIZES
        for number in range(n_worlds)
        for family in FAMILIES
        for expert in EXPERTS
    ]
    rows = measured_rows("belief_choice", cases, measure)
    save("belief_choice", "Belief or truth, chosen by evidence", summary(rows))


def measure(family: str, expert: str, demonstrations: int, world: int) -> dict[str, Any]:
    """Probability of each relation, and log-likelihoods of tied, free and the choice."""
    fresh, rng = fresh_world(family, expert, demonstrations, world)
    found = compare_beliefs(fresh.problem, fresh.demonstrations(demonstrations, rng))
    shares = zip(found.relations, found.probabilities.tolist(), strict=True)
    return (
        {type(relation).__name__: share for relation, share in shares}
        | {
            name: fresh.log_likelihood(fresh.problem, policy)
            for name, policy in policies_of(found).items()
        }
        | {"left out": list(found.left_out)}
    )


def fresh_world(
    family: str, expert: str, demonstrations: int, world: int
) -> tuple[World, np.random.Generator]:
    """A world, and the generator of its demonstrations."""
    first, draw = FAMILIES[family]
    place = (first, list(EXPERTS).index(expert))
    rng = np.random.default_rng([SEED, *place, demonstrations, world])
    return draw(rng, wrong_belief=EXPERTS[expert]), rng


def policies_of(found: BeliefComparison) -> dict[str, FloatArray]:
    """(S, A) policies averaged over the posterior: of tied and free, where compared, and chosen."""
    names = {TiedBelief(): "tied", FreeBelief(): "free"}
    draws = {"chosen": found.draws(np.random.default_rng(0))}
    for relation, one in zip(found.relations, found.approximations, strict=True):
        if relation in names:
            draws[names[relation]] = laplace_draws(one, np.random.default_rng(0))
    return {name: posterior_policy(found.problem, each) for name, each in draws.items()}


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row per family, expert and size."""
    table = []
    for family, expert, size in product(FAMILIES, EXPERTS, SIZES):
        case = {"family": family, "expert": expert, "demonstrations": size}
        all_here = [row for row in rows if row | case == row]
        here = [row for row in all_here if not row.get("left out")]
        tied, free, near = (
            np.array([row[relation.__name__] for row in here])
            for relation in (TiedBelief, FreeBelief, BeliefAroundTruth)
        )
        regret = [max(row["tied"], row["free"]) - row["chosen"] for row in here]
        gain, gain_of_free = (
            [row[name] - row["tied"] for row in here] for name in ("chosen", "free")
        )
        table.append(
            case
            | {
                "worlds": len(here),
                "not compared": len(all_here) - len(here),
                "not tied": float(np.mean(tied < 0.5)),
                "free": float(np.mean(free > np.maximum(tied, near))),
                "decided not tied": float(np.mean(tied < 0.05)),
                "mean regret": float(np.mean(regret)),
                "better than tied by": float(np.mean(gain)),
                "free better than tied by": float(np.mean(gain_of_free)),
            }
        )
    return table
