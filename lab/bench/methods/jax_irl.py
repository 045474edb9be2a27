"""Plain IRL in JAX: maximum likelihood of soft policies under counted dynamics.

Soft value iteration is unrolled and differentiated as it stands; SciPy ascends by BFGS from zero.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

jax.config.update("jax_enable_x64", True)
TITLE, REQUIREMENTS = "IRL in JAX", ("jax==0.10.2", "numpy==2.4.6", "scipy==1.17.1")
PRECISION, MOST_SWEEPS = 1e-6, 2000


@partial(jax.jit, static_argnames="n_sweeps")
@jax.value_and_grad
def loss(weights, features, transitions, available, choices, discount, n_sweeps):
    """Minus the log-likelihood of the (S, A) counts of decisions, and its gradient."""
    reward = jnp.where(available, features @ weights, -jnp.inf)

    def sweep(value, _):
        return jax.nn.logsumexp(reward + discount * transitions @ value, axis=1), None

    value, _ = jax.lax.scan(sweep, jnp.zeros(len(features)), None, length=n_sweeps)
    log_policy = jax.nn.log_softmax(reward + discount * transitions @ value, axis=1)
    return -jnp.sum(choices * jnp.where(available, log_policy, 0.0))


def learn(given):
    """Weights of highest likelihood."""
    if "transitions" not in given:
        raise NotImplementedError("one goal and moves that take no time")
    choices, discount = np.zeros(given["available"].shape), float(given["discount"])
    np.add.at(choices, (given["state"], given["action"]), 1.0)
    fixed = given["features"], given["transitions"], given["available"], choices, discount
    n_sweeps = min(MOST_SWEEPS, int(np.log(PRECISION) / np.log(discount)))

    def objective(weights):
        value, slope = loss(weights, *fixed, n_sweeps=n_sweeps)
        return float(value), np.asarray(slope, dtype=float)

    return {"weights": minimize(objective, np.zeros(fixed[0].shape[2]), jac=True).x}
