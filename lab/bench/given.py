"""What the project's own methods make of the arrays that a method is given."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

import serd_core as sc
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import reached
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.mdp.problem import Problem
from serd_core.semi_markov.models import has_laws, require_timed

#: Probability that a drawn outcome has at least, so that it has an energy.
LEAST = 1e-280


def problem_of(given: Mapping[str, Any], prefix: str = "") -> sc.TabularProblem | None:
    """The problem, or with the prefix `transfer_` the other one, None where there is none.

    NotImplementedError for many destinations.
    """
    if "n_models" not in given:
        raise NotImplementedError("one goal")
    if f"{prefix}features" not in given:
        return None
    names = ("successors", "model_of", "available")
    successors, model_of, available = (given[f"{prefix}{name}"] for name in names)
    models = sc.OutcomeModels(successors, model_of, available, int(given["n_models"]))
    features = given[f"{prefix}features"]
    feature_names = tuple(f"feature {number}" for number in range(features.shape[2]))
    mdp = sc.Mdp(models, float(given["discount"]))
    plain = sc.TabularProblem(mdp, features, feature_names)
    return sc.semi_markov_problem(plain) if "dwell_s" in given else plain


def decisions_of(given: Mapping[str, Any]) -> sc.Decisions:
    """The decisions, with dwell times where moves take time."""
    timed = "dwell_s" in given
    names = ["episode", "time_s", "state", "action", "next_state"]
    names += ["dwell_s", "censored"] if timed else []
    columns = {name: given[name] for name in names}
    return sc.TimedDecisions(**columns) if timed else sc.Decisions(**columns)


def averaged(
    problem: sc.TabularProblem | None, weights: Iterable[FloatArray], tables: Iterable[FloatArray]
) -> FloatArray | None:
    """(S, A) mean of the soft policies of (n, F) weights and (n, R, K) tables."""
    if problem is None:
        return None
    pairs = zip(weights, tables, strict=True)
    return np.asarray(np.mean([sc.soft_policy(problem, *pair).probabilities for pair in pairs], 0))


def counted_draws(
    problem: Problem,
    decisions: sc.Decisions,
    fit: sc.FitResult,
    n: int,
    rng: np.random.Generator,
    pseudo_count: float = 1.0,
) -> FloatArray:
    """(n, R, K) draws of the outcomes given the moves alone, of a fit under counted dynamics.

    pseudo_count: that it was counted with. Where moves take time, their laws are drawn too.
    """
    models, theta = problem.mdp.transitions, fit.parameters.truth
    assert isinstance(models, OutcomeModels)
    outcomes = require_timed(models).outcomes if has_laws(models) else models
    table = outcomes.local_probabilities(theta[: outcomes.n_energies])
    shown = reached(decisions)
    seen = np.bincount(
        outcomes.model_of[decisions.state, decisions.action], shown, minlength=len(table)
    )
    # The M-estimate is (n + c) / (N + K c).
    counts = table * (seen + pseudo_count * table.shape[1])[:, None]
    drawn = np.maximum(rng.gamma(counts, size=(n, *table.shape)), LEAST)
    drawn /= drawn.sum(axis=2, keepdims=True)
    if not has_laws(models):
        return np.asarray(drawn)
    # Imported here, since it takes longer than most fits.
    from lab.experiments.durations import counted_draws as timed_draws

    assert isinstance(decisions, sc.TimedDecisions)
    assert isinstance(problem, sc.TabularProblem)
    laws = timed_draws(problem, decisions, theta, n, rng)[:, outcomes.n_energies :]
    energies = [outcomes.parameters_of(each) for each in drawn]
    return np.asarray(models.local_probabilities(np.hstack([energies, laws])))
