"""IRL under the same prior as SERD: dynamics counted first, then rewards by evidence.

Averaged over draws as SERD is: of the rewards, and of the Dirichlet posterior of the counts. What
SERD has beyond this row is what joint estimation adds.
"""

import numpy as np

import serd_core as sc
from lab.bench.given import averaged, counted_draws, decisions_of, problem_of

TITLE, REQUIREMENTS = "IRL, counted dynamics, same prior", ()
N_DRAWS, N_OF_INTERVALS = 64, 400


def learn(given):
    """Count, fit the rewards by evidence, draw both."""
    problem, transfer = problem_of(given), problem_of(given, "transfer_")
    decisions = decisions_of(given)
    fit = sc.fit_mdce_irl_by_likelihood(problem, decisions, prior=sc.PriorByEvidence())
    rng = np.random.default_rng(0)
    posterior = sc.laplace(problem, decisions, fit)
    weights = sc.laplace_draws(posterior, rng, N_OF_INTERVALS).reward
    tables = counted_draws(problem, decisions, fit, N_OF_INTERVALS, rng)
    few = weights[:N_DRAWS], tables[:N_DRAWS]
    return {
        "policy": averaged(problem, *few),
        "transfer_policy": averaged(transfer, *few),
        "weights": fit.reward_weights,
        "table": tables.mean(axis=0),
        "draws_weights": weights,
        "draws_table": tables,
    }
