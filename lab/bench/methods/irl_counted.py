"""IRL as it is mostly done: dynamics counted, rewards of highest likelihood, one point.

Intervals are those of the standard errors, without that of the dynamics.
"""

import numpy as np

import serd_core as sc
from lab.bench.given import averaged, decisions_of, problem_of

TITLE, REQUIREMENTS = "IRL, counted dynamics", ()


def learn(given):
    """Weights of highest likelihood from zero on."""
    problem, transfer = problem_of(given), problem_of(given, "transfer_")
    decisions = decisions_of(given)
    start = np.zeros(given["features"].shape[2])
    fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, initial_weights=start)
    table = problem.mdp.transitions.local_probabilities(fit.parameters.truth)
    return {
        "policy": averaged(problem, [fit.reward_weights], [table]),
        "transfer_policy": averaged(transfer, [fit.reward_weights], [table]),
        "weights": fit.reward_weights,
        "table": table,
        "draws_weights": drawn(problem, decisions, fit),
    }


def drawn(problem, decisions, fit):
    """(n, F) normal draws by the standard errors; None where there are none."""
    try:
        errors = sc.standard_errors(problem, sc.fit_information(problem, decisions, fit)).reward
    except sc.SerdError:
        return None
    if not np.all(np.isfinite(errors)):
        return None
    return np.random.default_rng(0).normal(fit.reward_weights, errors, (400, len(errors)))
