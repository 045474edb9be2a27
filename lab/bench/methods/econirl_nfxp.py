"""econirl: nested fixed point (Rust 1987), maximum likelihood under known transitions."""

import jax.numpy as jnp
import numpy as np
from econirl.core.types import DDCProblem, Panel, Trajectory
from econirl.estimation.nfxp import NFXPEstimator
from econirl.preferences.linear import LinearUtility

TITLE = "econirl, NFXP"
REQUIREMENTS = ("econirl==0.1.1", "jax==0.10.2", "numpy==2.4.6", "scipy==1.17.1")
SEEDS = 6


def learn(given):
    """Weights, and normal draws by the standard errors."""
    if "transitions" not in given:
        raise NotImplementedError("one goal and moves that take no time")
    if not given["available"].all():
        raise NotImplementedError("the same actions in all states")
    n_states, n_actions, n_features = given["features"].shape
    names = [f"w{k}" for k in range(n_features)]
    found = NFXPEstimator(compute_hessian=True).estimate(
        panel_of(given),
        LinearUtility(jnp.asarray(given["features"]), names),
        DDCProblem(n_states, n_actions, float(given["discount"])),
        jnp.asarray(given["transitions"].transpose(1, 0, 2)),
        initial_params=jnp.zeros(n_features),
    )
    weights = np.asarray(found.parameters, dtype=float)
    errors = np.asarray(found.standard_errors, dtype=float)
    result = {"weights": weights}
    if np.all(np.isfinite(errors)):
        result["draws_weights"] = np.random.default_rng(0).normal(
            weights, errors, (400, n_features)
        )
    return result


def panel_of(given):
    """Demonstrations as econirl's panel."""
    episodes = [np.flatnonzero(given["episode"] == e) for e in np.unique(given["episode"])]
    columns = [given[name] for name in ("state", "action", "next_state")]
    return Panel([
        Trajectory(*(jnp.asarray(column[rows]) for column in columns), str(number))
        for number, rows in enumerate(episodes)
    ])  # fmt: skip
