"""Largest power that any test of a wrong belief can have in the worlds of `belief_choice`.

    python -m lab belief-bound

It goes on where it was stopped. The most powerful test of one model against another is that of
their likelihood ratio (Neyman and Pearson, Phil. Trans. R. Soc. A 231, 1933). The expert, whose
belief is wrong, is tested at 5 % false alarms against two experts whose belief is the truth: the
one with the same weights and true dynamics, and the nearest one, of any weights and dynamics, whose
decisions and transitions diverge least. A test that gives at most 5 % false alarms for every expert
who knows the dynamics has no more power than that against the nearest.

Such a test knows what the expert believes. One that must find it among d numbers, and looks in no
direction more than in others, has asymptotically no more power than the likelihood ratio of free
and tied (Wald, Trans. Am. Math. Soc. 54, 1943): that of chi-squared with d degrees of freedom and
noncentrality 2 x the nats from the nearest (Wilks, Ann. Math. Stat. 9, 1938).
"""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.stats

from lab.benchmarks.learning.belief_choice import FAMILIES, N_WORLDS, SIZES, fresh_world
from lab.benchmarks.learning.fresh_worlds import World
from lab.benchmarks.report import measured_rows, save
from serd_core.arrays import FloatArray
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.serd import fit_mdce_serd

#: Episodes to which the nearest model is fitted. Of 25 demonstrations, what its 51 numbers owe to
#: chance is 0.04 nats.
N_EPISODES = 15_000
VAGUE = PriorByEvidence(deviation=30.0, pseudo_count=0.1)
#: Data sets from each model for the distribution of the likelihood ratio.
N_DATA_SETS = 400
FALSE_ALARMS = 0.05


def run() -> None:
    """Measure the worlds that are missing, then write the table."""
    cases = [
        {"family": family, "demonstrations": size, "world": number}
        for size in SIZES
        for number in range(N_WORLDS)
        for family in FAMILIES
    ]
    rows = measured_rows("belief_bound", cases, measure)
    save("belief_bound", "Largest power of a test for a wrong belief", summary(rows))


def measure(family: str, demonstrations: int, world: int) -> dict[str, float]:
    """Nats by which the demonstrations diverge from either model, and the power against it."""
    fresh, _ = fresh_world(family, "believes others", demonstrations, world)
    rng = np.random.default_rng([demonstrations, world])
    fit = fit_mdce_serd(fresh.problem, fresh.demonstrations(N_EPISODES, rng), prior=VAGUE)
    table = fit.outcome_probabilities
    nearest = replace(fresh, weights=fit.reward_weights, truth=table, belief=table)
    knowing = replace(fresh, belief=fresh.truth)
    found: dict[str, float] = {}
    for name, other in (("nearest", nearest), ("knowing", knowing)):
        divergence, power = power_against(fresh, other, demonstrations, rng)
        found |= {f"nats, {name}": divergence, f"power, {name}": power}
    models, outcomes = fresh.truth.shape
    size = models * (outcomes - 1)
    limit = scipy.stats.chi2.isf(FALSE_ALARMS, size)
    blind = scipy.stats.ncx2.sf(limit, size, 2.0 * max(found["nats, nearest"], 0.0))
    return found | {"belief numbers": size, "power, belief unknown": float(blind)}


def power_against(
    expert: World, other: World, n_episodes: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Mean log likelihood ratio of the expert's demonstrations, and power of its test."""
    under = [log_ratios(expert, other, drawn, n_episodes, rng) for drawn in (expert, other)]
    limit = np.quantile(under[1], 1.0 - FALSE_ALARMS)
    return float(np.mean(under[0])), float(np.mean(under[0] > limit))


def log_ratios(
    expert: World, other: World, drawn: World, n_episodes: int, rng: np.random.Generator
) -> FloatArray:
    """(n,) log likelihood ratios of expert to other in data sets of `drawn`."""
    decisions = drawn.demonstrations(N_DATA_SETS * n_episodes, rng)
    model = expert.problem.mdp.transitions
    row = decisions.state * model.n_actions + decisions.action
    ratio = np.zeros(len(decisions))
    for world, sign in ((expert, 1.0), (other, -1.0)):
        chosen = world.policy(world.problem).ravel()[row]
        moved = transitions_of(model, world.truth).matrix.toarray()[row, decisions.next_state]
        ratio += sign * np.log(chosen * moved)
    return np.bincount(decisions.episode // n_episodes, ratio, N_DATA_SETS)


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row per family and size."""
    table = []
    for family in FAMILIES:
        for size in SIZES:
            case = {"family": family, "demonstrations": size}
            here = [row for row in rows if row | case == row]
            nats = [row["nats, nearest"] for row in here]
            powers = ("power, knowing", "power, nearest", "power, belief unknown")
            table.append(
                case
                | {"worlds": len(here), "belief numbers": here[0]["belief numbers"]}
                | {"median nats": float(np.median(nats))}
                | {name: float(np.mean([row[name] for row in here])) for name in powers}
            )
    return table
