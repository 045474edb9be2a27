"""The thesis's own Q-gradients, the reference twin of the adjoint (Eqs. 4.21, 4.66, Table 4.2).

    dQ(s,a)/d_i = dR(s,a)/d_i + gamma sum_s' dP(s'|s,a)/d_i V(s')
                  + gamma sum_s' P(s'|s,a) sum_a' pi(a'|s') dQ(s',a')/d_i

Soft Q-gradient with the Boltzmann policy, hard Q-gradient with the greedy one. Both costs grow
with the number of parameters; nothing but tests and the cost experiment needs them.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from serd_core.arrays import FloatArray
from serd_core.dynamics.transition_model import Transitions
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp


@dataclass(frozen=True, eq=False)
class QGradient:
    """(S, A, N) derivative of Q by N parameters, with how it was reached."""

    values: FloatArray
    steps: int
    residual: float
    converged: bool


def immediate_gradient(
    mdp: Mdp, features: FloatArray, value: FloatArray, entry_jacobian: FloatArray
) -> FloatArray:
    """(S, A, F + N) first two terms of (4.21): features, then gamma dP/d_i V.

    entry_jacobian: (E, N) derivative of the entries of P by the dynamics parameters.
    """
    model = mdp.transitions
    weighted = entry_jacobian * value[model.successor][:, None]
    n_rows = mdp.n_states * mdp.n_actions
    sums = np.zeros((n_rows, entry_jacobian.shape[1]))
    np.add.at(sums, model.row, weighted)
    dynamics = mdp.discount * sums.reshape(mdp.n_states, mdp.n_actions, -1)
    usable = np.where(mdp.available[:, :, None], features, 0.0)
    return np.concatenate([usable, dynamics], axis=2)


def entry_jacobian(mdp: Mdp, parameters: FloatArray) -> FloatArray:
    """(E, N) derivative of the entries of P by each dynamics parameter."""
    model = mdp.transitions
    n_entries = len(model.successor)
    local_shape = np.shape(model.local_probabilities(parameters))
    n_local = int(np.prod(local_shape))
    local_jacobian = np.stack(
        [model.pull_back(parameters, unit.reshape(local_shape)) for unit in np.eye(n_local)]
    )
    basis = [model.entries(unit.reshape(local_shape)) for unit in np.eye(n_local)]
    return np.stack(basis, axis=1).reshape(n_entries, n_local) @ local_jacobian


def q_gradient_by_iteration(
    mdp: Mdp,
    transitions: Transitions,
    policy: FloatArray,
    immediate: FloatArray,
    *,
    initial: FloatArray | None = None,
    accuracy: float = 1e-10,
    max_sweeps: int = 1_000_000,
) -> QGradient:
    """Apply (4.21) as an operator until its residual certifies `accuracy` (Theorem 4.4.8)."""
    gradient = immediate if initial is None else initial
    target = accuracy * (1.0 - mdp.discount)
    for sweep in range(1, max_sweeps + 1):
        expected = np.einsum("sa,san->sn", policy, gradient)
        successor = (transitions.matrix @ expected).reshape(immediate.shape)
        updated = immediate + mdp.discount * successor
        residual = float(np.max(np.abs(updated - gradient)))
        gradient = updated
        if residual <= target * max(1.0, float(np.max(np.abs(gradient)))):
            return QGradient(gradient, sweep, residual, converged=True)
    return QGradient(gradient, max_sweeps, residual, converged=False)


def q_gradient_by_lu(
    mdp: Mdp, transitions: Transitions, policy: FloatArray, immediate: FloatArray
) -> QGradient:
    """Solve (4.21) as one linear system of size (S*A) x (S*A) (Table 4.2, first row)."""
    n_pairs = mdp.n_states * mdp.n_actions
    states = np.repeat(np.arange(mdp.n_states), mdp.n_actions)
    choose = scipy.sparse.csr_array(
        (policy.ravel(), (states, np.arange(n_pairs))), shape=(mdp.n_states, n_pairs)
    )
    system = scipy.sparse.csr_array(scipy.sparse.identity(n_pairs)) - mdp.discount * (
        transitions.matrix @ choose
    )
    right_side = immediate.reshape(n_pairs, -1)
    solution = scipy.sparse.linalg.splu(system.tocsc()).solve(right_side)
    residual = float(np.max(np.abs(system @ solution - right_side)))
    if not np.isfinite(residual):
        raise SerdError("immediate gradient must be finite, the solve gave NaN; check the inputs")
    return QGradient(solution.reshape(immediate.shape), 1, residual, converged=True)
