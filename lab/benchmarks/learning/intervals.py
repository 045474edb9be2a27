"""Whether 90 % intervals hold the truth, how wide they are, and what predictions are worth.

    python -m lab intervals
    python -m lab intervals --worlds 10

It goes on where it was stopped. Weights and dynamics are drawn from the prior of each family, which
one fit knows (the oracle) and the others do not. The interval score is its width, and 20 times the
distance of the truth from an interval that does not hold it (Gneiting and Raftery, JASA 2007):
weights in nats over the range of their feature, outcomes in shares, times in nats of log seconds.
Numbers that `outcome_information` or `dwell_summary` call the prior's are counted apart.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

from lab.benchmarks.report import measured_rows, save
from lab.posterior.calibration import demonstrated, drawn_truth, fit_by_own_prior
from lab.posterior.families import FAMILIES, Family
from serd_core.arrays import BoolArray, FloatArray
from serd_core.bayes.information import OutcomeInformation, outcome_information
from serd_core.bayes.laplace import laplace, posterior_policy
from serd_core.demonstrations.decisions import Decisions
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.learners.serd import fit_mdce_serd
from serd_core.posterior.coordinates import feature_ranges
from serd_core.selection.evaluation import fitted_policy
from serd_core.semi_markov.models import SemiMarkovModels
from serd_core.semi_markov.place import dwell_summary

SIZES = (3, 25)
PRIORS = ("evidence", "oracle")
KINDS = ("weights", "outcomes", "times")
#: Draws over which policies are averaged, and episodes on which they are scored.
N_AVERAGED, HELD_OUT = 64, 200
Worlds = Annotated[int, typer.Option("--worlds", help="worlds per kind and size")]


def run(n_worlds: Worlds = 40) -> None:
    """Measure the worlds that are missing."""
    cases = [
        {"family": family, "demonstrations": size, "world": number, "prior": prior}
        for number in range(n_worlds)
        for family in FAMILIES
        for size in SIZES
        for prior in PRIORS
    ]
    measured, rows = measured_rows("intervals", cases, measure), []
    for family in FAMILIES:
        for size in SIZES:
            for prior in PRIORS:
                case = {"family": family, "demonstrations": size, "prior": prior}
                here = [each for each in measured if each | case == each]
                rows.append(case | _summary([each for each in here if not each["failure"]]))
    save("intervals", "Intervals of 90 %", rows)


def _summary(found: list[dict[str, object]]) -> dict[str, object]:
    """Of the worlds of one row."""
    row: dict[str, object] = {"worlds": len(found)}
    for kind in KINDS:
        table = np.array([each for one in found for each in one[kind]]).reshape(-1, 4)
        known = table[table[:, 0] > 0]
        row |= {f"{kind}: intervals": len(known), "held": float(known[:, 1].mean())}
        row[f"{kind}: held"] = row.pop("held")
        row[f"{kind}: width"] = float(known[:, 2].mean())
        row[f"{kind}: score"] = float(known[:, 3].mean())
    for name in ("mode", "average"):
        row[name] = float(np.mean([one[name] for one in found]))
    return row


def measure(family: str, demonstrations: int, world: int, prior: str) -> dict[str, object]:
    """Of each number (from data, held, width, score), and log-likelihoods of held-out choices."""
    rng = np.random.default_rng([sorted(FAMILIES).index(family), demonstrations, world, 11])
    place = replace(FAMILIES[family](), n_episodes=demonstrations)
    weights, truth = drawn_truth(place, rng)
    decisions = demonstrated(place, weights, truth, rng)
    held_out = demonstrated(replace(place, n_episodes=HELD_OUT), weights, truth, rng)
    try:
        fit = _fit(place, decisions, prior)
        numbers, known = _numbers(place, decisions, fit, (weights, truth))
    except SerdError as error:
        return {"failure": str(error)}
    chosen = np.linspace(0, len(known.draws) - 1, N_AVERAGED).astype(int)
    draws = replace(
        known.draws,
        reward=known.draws.reward[chosen],
        believed_outcome_probabilities=known.draws.believed_outcome_probabilities[chosen],
    )
    policies = {
        "mode": fitted_policy(place.problem, fit),
        "average": posterior_policy(place.problem, draws),
    }
    likely = {
        name: float(np.log(policy[held_out.state, held_out.action]).mean())
        for name, policy in policies.items()
    }
    return {"failure": ""} | numbers | likely


def _fit(place: Family, decisions: Decisions, prior: str) -> FitResult:
    if prior == "oracle":
        return fit_by_own_prior(place, decisions)
    return fit_mdce_serd(place.problem, decisions)


def _numbers(
    place: Family, decisions: Decisions, fit: FitResult, true: tuple[FloatArray, FloatArray]
) -> tuple[dict[str, object], OutcomeInformation]:
    """Of each number that has an interval: whether it is from data, held, its width and score."""
    problem, (weights, truth) = place.problem, true
    posterior, ranges = laplace(problem, decisions, fit), feature_ranges(place.problem)
    known = outcome_information(posterior)
    models = problem.mdp.transitions.moves
    named = np.array([known.source_of_weight(f) != "prior only" for f in range(len(weights))])
    outcomes = [
        [known.source_of_outcome(m, k) != "prior only" for k in range(models.n_outcomes)]
        for m in range(models.n_models)
    ]
    limits = np.stack([known.lower, known.upper])
    probabilities = models.local_probabilities(truth)
    found = {
        "weights": _scored(weights * ranges, known.weights[[0, 2]] * ranges, named),
        "outcomes": _scored(probabilities, limits, np.array(outcomes)),
        "times": [],
    }
    model = problem.mdp.transitions
    if isinstance(model, SemiMarkovModels):
        laws = dwell_summary(posterior, known.draws)
        informed = np.array([laws.source(law) != "prior only" for law in range(model.n_laws)])
        log_s = np.log(laws.mean_interval_s[[0, 2]])
        found["times"] = _scored(truth[model.means], log_s, informed)
    return found, known


def _scored(truth: FloatArray, limits: FloatArray, informed: BoolArray) -> list[list[float]]:
    lower, upper = (each.ravel() for each in limits)
    true, from_data = truth.ravel(), informed.ravel()
    width, outside = upper - lower, np.maximum(np.maximum(lower - true, true - upper), 0.0)
    rows = np.stack([from_data, outside == 0.0, width, width + 20.0 * outside], axis=1)
    return [[float(each) for each in row] for row in rows[~np.isnan(width)]]
