"""A baseline in JAX: rewards and dynamics at once by automatic differentiation, fixed prior.

Weights ~ Normal(0, 3), outcomes ~ Dirichlet(1); dense, climbed by SciPy's L-BFGS. At the fixed
point V of Newton steps one more, V + (I - discount P_pi)^-1 (T(V) - V), in which V and the matrix
are constants, has the exact derivatives.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.lax import stop_gradient
from scipy.optimize import minimize

jax.config.update("jax_enable_x64", True)
TITLE, REQUIREMENTS = "joint MAP in JAX", ("jax==0.10.2", "numpy==2.4.6", "scipy==1.17.1")


@jax.jit
@jax.value_and_grad
def loss(x, features, rows, after, available, choices, moved, discount):
    """Minus the log posterior at weights and log odds, (F + R K,), and its gradient."""
    weights, odds = x[: features.shape[2]], x[features.shape[2] :]
    table = jax.nn.softmax(odds.reshape(-1, after.shape[2]))
    step = (table[rows][..., None] * after).sum(axis=2)
    reward = jnp.where(available, features @ weights, -jnp.inf)

    def newton(value, _=None):
        value = stop_gradient(value)
        q = reward + discount * step @ value
        policy = jax.nn.softmax(q, axis=1)
        matrix = jnp.eye(len(q)) - discount * jnp.einsum("sa,sat->st", policy, step)
        change = jax.nn.logsumexp(q, axis=1) - value
        return value + jnp.linalg.solve(stop_gradient(matrix), change), None

    value, _ = newton(jax.lax.scan(newton, jnp.zeros(len(features)), None, length=30)[0])
    chosen = jnp.where(available, reward + discount * step @ value - value[:, None], 0.0)
    seen = jnp.sum(moved * jnp.log(jnp.where(moved > 0, step, 1.0)))
    prior = jnp.sum(jnp.log(table)) - 0.5 * jnp.sum((weights / 3.0) ** 2)
    return -(jnp.sum(choices * chosen) + seen + prior)


def learn(given):
    """Weights and outcomes of a highest posterior, from zero weights and counted outcomes on."""
    if "transitions" not in given:
        raise NotImplementedError("one goal and moves that take no time")
    features, shape = given["features"], given["successors"].shape
    choices, moved = np.zeros(shape[:2]), np.zeros((*shape[:2], shape[0]))
    np.add.at(choices, (given["state"], given["action"]), 1.0)
    np.add.at(moved, (given["state"], given["action"], given["next_state"]), 1.0)
    fixed = features, given["model_of"], np.eye(shape[0])[given["successors"]], given["available"]

    def objective(x):
        value, slope = loss(x, *fixed, choices, moved, float(given["discount"]))
        return float(value), np.asarray(slope, dtype=float)

    n_features = features.shape[2]
    start = np.concatenate([np.zeros(n_features), np.log(given["counted"]).ravel()])
    found = minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 500})
    table = jax.nn.softmax(found.x[n_features:].reshape(given["counted"].shape))
    return {"weights": found.x[:n_features], "table": np.asarray(table)}
