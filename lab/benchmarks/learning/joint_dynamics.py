"""How often the rule for joint or counted dynamics alarms, where it should and where it should not.

    python -m lab joint-dynamics
    python -m lab joint-dynamics --worlds 10

It goes on where it was stopped. In the worlds of `lab.posterior.families`, whose weights and
dynamics are drawn from a prior of 2 nats and 1 pseudo-count, an expert believes in the truth
(alarms are false) or in other dynamics, drawn from the same prior.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import demonstrated, drawn_truth
from lab.posterior.families import FAMILIES
from serd_core.bayes.strengths import PriorByEvidence
from serd_core.errors import SerdError
from serd_core.learners.serd import fit_mdce_serd
from serd_core.selection.joint_dynamics import judge_joint_dynamics

SIZES = (6, 30)
EXPERTS = ("believes the truth", "believes other dynamics")
PRIOR = PriorByEvidence(deviation=2.0, pseudo_count=1.0)
Worlds = Annotated[int, typer.Option("--worlds", help="worlds per kind, size and expert")]


def run(n_worlds: Worlds = 30) -> None:
    """Judge the worlds that are missing."""
    cases = [
        {"family": family, "demonstrations": size, "expert": expert, "world": number}
        for number in range(n_worlds)
        for family in FAMILIES
        for size in SIZES
        for expert in EXPERTS
    ]
    measured, rows = measured_rows("joint_dynamics", cases, measure), []
    for family in (*FAMILIES, "all"):
        for size in SIZES:
            row: dict[str, object] = {"family": family, "demonstrations": size}
            for expert in EXPERTS:
                here = [
                    each
                    for each in measured
                    if each["expert"] == expert
                    and each["demonstrations"] == size
                    and family in (each["family"], "all")
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
    seeds = [sorted(FAMILIES).index(family), demonstrations, EXPERTS.index(expert), world, 7]
    rng = np.random.default_rng(seeds)
    place = replace(FAMILIES[family](), n_episodes=demonstrations)
    weights, truth = drawn_truth(place.problem, PRIOR, rng)
    other = drawn_truth(place.problem, PRIOR, rng)[1]
    belief = None if expert == EXPERTS[0] else other
    decisions = demonstrated(place, weights, truth, rng, belief)
    try:
        fit = fit_mdce_serd(place.problem, decisions)
        found = judge_joint_dynamics(place.problem, decisions, fit, rng)
    except SerdError as error:
        return {"failure": str(error)}
    return {
        "failure": "",
        "chosen": found.chosen,
        "point": found.point,
        "lead": found.lead_nats,
        "cost": found.cost_nats,
    }
