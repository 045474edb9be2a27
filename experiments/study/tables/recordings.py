"""Tables of what was recorded: the reference dynamics, and the demonstrations of every expert."""

import numpy as np

from experiments.running.repetitions import Row
from experiments.study.recordings.demonstration_sets import ROLES
from experiments.study.recordings.demonstrations import load_sets, n_repetitions
from experiments.study.recordings.experts import EXPERTS
from experiments.study.recordings.reference import reference_decisions
from experiments.study.tables.results import Results
from serd_core.arrays import FloatArray, IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.grid.grid import Outcome
from serd_core.grid.navigation import NavigationProblem


def reference_table(results: Results) -> list[Row]:
    """The dynamics the study calls true: probability of every outcome, and how often observed."""
    decisions = reference_decisions(results.folder / "reference")
    probabilities = estimate_dynamics(results.problem, decisions)
    counts = _per_model(results.problem, decisions)
    return [
        {"model": name, "decisions": int(counts[number])} | _outcomes(probabilities[number])
        for number, name in enumerate(results.problem.model_names)
    ]


def demonstrations_table(results: Results) -> list[Row]:
    """One row per expert and set, over all repetitions; shares of decisions by outcome model."""
    period_s = results.scenario.decision_period_s
    table: list[Row] = []
    for expert in EXPERTS:
        every = [
            load_sets(results.folder / "demonstrations", expert, number)
            for number in range(n_repetitions(results.settings, expert))
        ]
        for role in ROLES:
            sets = [getattr(each, role) for each in every]
            n_decisions = sum(len(each) for each in sets)
            n_episodes = sum(len(each.episodes) for each in sets)
            counts = sum(_per_model(results.problem, each) for each in sets)
            shares = np.asarray(counts) / n_decisions
            table.append(
                {
                    "expert": expert,
                    "set": role,
                    "repetitions": len(sets),
                    "episodes": n_episodes,
                    "decisions": n_decisions,
                    "mean_s": period_s * n_decisions / n_episodes,
                }
                | dict(zip(results.problem.model_names, map(float, shares), strict=True))
            )
    return table


def _per_model(problem: NavigationProblem, decisions: Decisions) -> IntArray:
    models = problem.outcome_models
    used = models.model_of[decisions.state, decisions.action]
    return np.bincount(used, minlength=models.n_models)


def _outcomes(probabilities: FloatArray) -> Row:
    return {outcome.name.lower(): float(probabilities[outcome]) for outcome in Outcome}
