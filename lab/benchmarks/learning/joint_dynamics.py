"""How often the rule for joint or counted dynamics alarms, where it should and where it should not.

    python -m lab joint-dynamics
    python -m lab joint-dynamics --worlds 10

It goes on where it was stopped. An expert believes in the truth (alarms are false) or in other
dynamics, drawn from the same prior. The threshold of the rule was fixed on `FAMILIES`. `FRESH` was
written after it: there the strengths are drawn too, 1 to 4 nats and a half to 2 pseudo-counts.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import demonstrated, drawn_truth
from lab.posterior.families import FAMILIES, FRESH
from serd_core.bayes.laplace import laplace, laplace_draws, posterior_policy
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.selection.evaluation import fitted_policy
from serd_core.selection.joint_dynamics import N_DRAWS, judge_joint_dynamics

SIZES = (6, 30)
#: Episodes whose choices policies are scored on.
HELD_OUT = 200
EVERY = FAMILIES | FRESH
EXPERTS = ("believes the truth", "believes other dynamics")
Worlds = Annotated[int, typer.Option("--worlds", help="worlds per kind, size and expert")]


def run(n_worlds: Worlds = 30) -> None:
    """Judge the worlds that are missing."""
    cases = [
        {"family": family, "demonstrations": size, "expert": expert, "world": number}
        for number in range(n_worlds)
        for family in EVERY
        for size in SIZES
        for expert in EXPERTS
    ]
    measured, rows = measured_rows("joint_dynamics", cases, measure), []
    groups = {"fixed on": tuple(FAMILIES), "fresh": tuple(FRESH)}
    for family, members in ({each: (each,) for each in EVERY} | groups).items():
        for size in SIZES:
            row: dict[str, object] = {"family": family, "demonstrations": size}
            for expert in EXPERTS:
                here = [
                    each
                    for each in measured
                    if each["expert"] == expert
                    and each["demonstrations"] == size
                    and each["family"] in members
                    and not each["failure"]
                ]
                row[f"{expert}: worlds"] = len(here)
                row["alarms"] = float(np.mean([each["chosen"] != "joint" for each in here]))
                row[f"{expert}: alarms"] = row.pop("alarms")
                row[f"{expert}: point joint"] = float(
                    np.mean([each["point"] == "joint" for each in here])
                )
            rows.append(row)
    save("joint_dynamics", "Joint or counted dynamics", rows)


def measure(family: str, demonstrations: int, expert: str, world: int) -> dict[str, object]:
    """The verdict in one world."""
    seeds = [sorted(EVERY).index(family), demonstrations, EXPERTS.index(expert), world, 7]
    rng = np.random.default_rng(seeds)
    place = replace(EVERY[family](), n_episodes=demonstrations)
    if family in FRESH:
        deviation, count = np.exp(rng.uniform(np.log([1.0, 0.5]), np.log([4.0, 2.0]))).tolist()
        place = replace(place, deviations=deviation, pseudo_counts=count)
    weights, truth = drawn_truth(place, rng)
    other = drawn_truth(place, rng)[1]
    belief = None if expert == EXPERTS[0] else other
    decisions = demonstrated(place, weights, truth, rng, belief)
    held_out = demonstrated(replace(place, n_episodes=HELD_OUT), weights, truth, rng, belief)
    try:
        fit = fit_mdce_serd(place.problem, decisions)
        posterior = laplace(place.problem, decisions, fit)
        draws = laplace_draws(posterior, rng, N_DRAWS)
        found = judge_joint_dynamics(posterior, decisions, rng, draws)
    except SerdError as error:
        return {"failure": str(error)}
    policies = {
        "mode": fitted_policy(place.problem, fit),
        "counted": fitted_policy(place.problem, found.counted),
        "average": posterior_policy(place.problem, draws),
    }
    likely = {
        f"held out, {name}": float(np.log(policy[held_out.state, held_out.action]).mean())
        for name, policy in policies.items()
    }
    verdict = {"chosen": found.chosen, "point": found.point}
    return {"failure": "", "lead": found.lead_nats, "cost": found.cost_nats} | verdict | likely
