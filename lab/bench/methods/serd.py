"""SERD with its defaults: rewards and dynamics together, predicted by the posterior average.

Intervals are those that `serd learn` writes: not of weights that are the prior's, or that have not
mixed.
"""

import numpy as np

import serd_core as sc
from lab.bench.given import decisions_of, problem_of
from serd_core.bayes.information import PRIOR_ONLY

TITLE, REQUIREMENTS = "SERD", ()
N_DRAWS = 64


def learn(given):
    """Fit by evidence, then draw from the posterior; routes have no dynamics to learn."""
    if "network_features" in given:
        return {"weights": routes(given)}
    problem, transfer = problem_of(given), problem_of(given, "transfer_")
    decisions = decisions_of(given)
    fit = sc.fit_mdce_serd(problem, decisions)
    posterior = sc.laplace(problem, decisions, fit)
    draws = sc.laplace_draws(posterior, np.random.default_rng(0), N_DRAWS)
    known = sc.outcome_information(posterior)
    sources = [known.source_of_weight(f) for f in range(len(fit.reward_weights))]
    return {
        "policy": sc.posterior_policy(problem, draws),
        "transfer_policy": None if transfer is None else sc.posterior_policy(transfer, draws),
        "weights": fit.reward_weights,
        "table": draws.outcome_probabilities.mean(axis=0),
        "draws_weights": known.draws.reward,
        "draws_table": known.draws.outcome_probabilities,
        "unstated": np.isnan(known.weights[0]) | (np.array(sources) == PRIOR_ONLY),
    }


def routes(given):
    """The weights of the recursive logit."""
    from lab.routes.network import RouteNetwork, Trips
    from lab.routes.recursive_logit import fit_routes

    features = given["network_features"]
    names = tuple(f"feature {number}" for number in range(features.shape[1]))
    ends = given["network_from_link"], given["network_to_link"]
    links = int(given["network_n_links"])
    network = RouteNetwork(links, *ends, features, names, given["network_exits"])
    parts = (given[f"trips_{name}"] for name in ("origin", "destinations", "to", "features"))
    return fit_routes(network, Trips(*parts)).weights
