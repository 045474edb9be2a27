"""IRL under the same prior as SERD: dynamics counted first, then rewards, with SERD's strengths.

Predicted under the counted dynamics, averaged over draws of the rewards, which is better than to
average over both; intervals of outcomes are those of their Dirichlet posterior. What SERD has
beyond this row is what joint estimation adds. Its time includes the fit that found the strengths.
"""

import numpy as np

import serd_core as sc
from lab.bench.given import averaged, counted_draws, decisions_of, problem_of
from serd_core.bayes.strengths import strengths_of

TITLE, REQUIREMENTS = "IRL, counted dynamics, same prior", ()
N_DRAWS, N_OF_INTERVALS = 64, 400


def learn(given):
    """Count under SERD's prior, fit the rewards under it, draw both."""
    problem, transfer = problem_of(given), problem_of(given, "transfer_")
    decisions = decisions_of(given)
    found = strengths_of(sc.fit_mdce_serd(problem, decisions).assumed.prior, problem)
    count, prior = found["pseudo_count"], sc.PriorByEvidence(deviation=found["deviation"])
    dynamics = sc.estimate_dynamics(problem, decisions, count)
    fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, dynamics=dynamics, prior=prior)
    rng = np.random.default_rng(0)
    weights = sc.laplace_draws(sc.laplace(problem, decisions, fit), rng, N_OF_INTERVALS).reward
    tables = counted_draws(problem, decisions, fit, N_OF_INTERVALS, rng, count)
    known = [problem.mdp.transitions.local_probabilities(fit.parameters.truth)] * N_DRAWS
    return {
        "policy": averaged(problem, weights[:N_DRAWS], known),
        "transfer_policy": averaged(transfer, weights[:N_DRAWS], known),
        "weights": fit.reward_weights,
        "table": tables.mean(axis=0),
        "draws_weights": weights,
        "draws_table": tables,
    }
