"""econirl: NFXP (maximum likelihood) or MCE IRL (feature matching) on a problem from a file.

    python econirl_fit.py nfxp|mce_irl problem.npz result.json

Run in the environment of learning.txt. Timed is one estimation without standard errors, the better
of two so that JAX has compiled, in processor time.
"""

import json
import sys
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from econirl.core.types import DDCProblem, Panel, Trajectory
from econirl.estimation.mce_irl import MCEIRLEstimator
from econirl.estimation.nfxp import NFXPEstimator
from econirl.preferences.linear import LinearUtility
from econirl.preferences.reward import LinearReward


def main(method: str, problem_file: Path, result_file: Path) -> None:
    """Fit twice, write weights, seconds and whether the library reports convergence."""
    given = np.load(problem_file)
    n_states, n_actions, n_features = given["features"].shape
    names = [f"w{k}" for k in range(n_features)]
    problem = DDCProblem(n_states, n_actions, float(given["discount"]))
    transitions = jnp.asarray(given["transitions"].transpose(1, 0, 2))
    if method == "nfxp":
        estimator = NFXPEstimator(compute_hessian=False)
        utility = LinearUtility(jnp.asarray(given["features"]), names)
    else:
        # "root" solves the equations of feature matching; the default maximises a likelihood.
        estimator = MCEIRLEstimator(optimizer="root", compute_se=False, inner_tol=1e-10)
        utility = LinearReward(jnp.asarray(given["features"][:, 0]), names, n_actions)
    seconds = []
    for _ in range(2):
        began_s = time.process_time()
        fit = estimator.estimate(
            panel_of(given), utility, problem, transitions, initial_params=jnp.zeros(n_features)
        )
        weights = np.asarray(fit.parameters, dtype=np.float64).tolist()
        seconds.append(time.process_time() - began_s)
    result = {"weights": weights, "seconds": min(seconds), "converged": bool(fit.converged)}
    result_file.write_text(json.dumps(result))


def panel_of(given: dict) -> Panel:
    """Demonstrations as econirl's panel."""
    episodes = [np.flatnonzero(given["episode"] == e) for e in np.unique(given["episode"])]
    columns = [given[name] for name in ("state", "action", "next_state")]
    return Panel([Trajectory(*(jnp.asarray(column[rows]) for column in columns), str(number))
                  for number, rows in enumerate(episodes)])  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
