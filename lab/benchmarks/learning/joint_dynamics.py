"""How often the rule for joint or counted dynamics alarms, where it should and where it should not.

    python -m lab joint-dynamics
    python -m lab joint-dynamics --worlds 10

It goes on where it was stopped. An expert believes in the truth (alarms are false) or in other
dynamics, drawn from the same prior. The threshold of the rule was fixed on `FAMILIES`. `FRESH` was
written after it: there the strengths are drawn too, 1 to 4 nats and a half to 2 pseudo-counts.
"""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import typer

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import demonstrated, drawn_truth
from lab.posterior.families import FAMILIES, FRESH, Family
from serd_core.arrays import FloatArray
from serd_core.bayes.laplace import laplace, laplace_draws, posterior_policy
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.selection.evaluation import fitted_policy
from serd_core.selection.joint_dynamics import N_DRAWS, judge_joint_dynamics

SIZES = (6, 30)
POLICIES = "mode", "counted", "average"
#: Nats by which as many moves again are likelier under counted dynamics where joint ones do harm.
HARMFUL = 3.0
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
            for expert in EXPERTS:
                case = {"demonstrations": size, "expert": expert, "failure": ""}
                here = [row for row in measured if row | case == row and row["family"] in members]
                rows.append({"family": family} | case | _summary(here))
    save("joint_dynamics", "Joint or counted dynamics", rows)


def _summary(found: list[dict[str, Any]]) -> dict[str, object]:
    """Of the worlds of one row: alarms, and log-likelihoods of held-out choices."""
    alarm = np.array([each["chosen"] != "joint" for each in found])
    harmful = np.array([each["lost"] > HARMFUL for each in found])
    likely = {name: np.array([each[f"held out, {name}"] for each in found]) for name in POLICIES}
    leads = np.array([each["lead"] > 1.0 for each in found])
    likely["mode where it leads"] = np.where(leads & ~alarm, likely["mode"], likely["counted"])
    return {
        "worlds": len(found),
        "alarms": int(alarm.sum()),
        "no reward": sum(each["chosen"] == "neither" for each in found),
        "harmful": int(harmful.sum()),
        "harmful: alarms": int((harmful & alarm).sum()),
    } | {name: float(values.mean()) for name, values in likely.items()}


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
    again = demonstrated(place, weights, truth, rng, belief)
    try:
        fit = fit_mdce_serd(place.problem, decisions)
        posterior = laplace(place.problem, decisions, fit)
        draws = laplace_draws(posterior, rng, N_DRAWS)
        found = judge_joint_dynamics(posterior, decisions, rng, draws)
    except SerdError as error:
        return {"failure": str(error)}
    fitted = fit, found.counted
    policies = (
        *(fitted_policy(place.problem, each) for each in fitted),
        posterior_policy(place.problem, draws),
    )
    likely = {
        f"held out, {name}": float(np.log(policy[held_out.state, held_out.action]).mean())
        for name, policy in zip(POLICIES, policies, strict=True)
    }
    joint, counted = (_of_moves(place, again, each.parameters.truth) for each in fitted)
    verdict = {"failure": "", "chosen": found.chosen, "lost": counted - joint}
    return verdict | {"lead": found.lead_nats, "cost": found.cost_nats} | likely


def _of_moves(place: Family, decisions: Decisions, truth: FloatArray) -> float:
    """Log-likelihood of moves under (N,) parameters of the dynamics."""
    models = place.problem.mdp.transitions.moves
    table = models.local_probabilities(truth[: models.n_energies])
    pairs = decisions.state, decisions.action
    leads = models.successors[pairs] == decisions.next_state[:, None]
    return float(np.log((table[models.model_of[pairs]] * leads).sum(axis=1)).sum())
