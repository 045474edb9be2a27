"""Second derivatives of the policy's log-likelihood by rewards, believed dynamics, temperature.

With the Lagrangian J(Q) + lambda . (T(Q, theta) - Q) at the converged Q and its adjoint lambda,

    d2J = dQ^T (J_QQ + lambda T_QQ) dQ + 2 lambda T_Qtheta dQ + lambda T_thetatheta

    J_QQ       = -n(s) / temperature^2 Cov_pi,       T_QQ = y(s) Cov_pi for soft, 0 for hard
    T_Qtheta   = gamma dP dV,                        T_thetatheta = gamma d2P V

where y = gamma P^T lambda is the state part of the adjoint.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray
from serd_core.derivatives.adjoint import Adjoint
from serd_core.derivatives.sensitivities import Sensitivities
from serd_core.dynamics.transitions import Transitions


@dataclass(frozen=True, eq=False)
class CurvatureParts:
    """Everything the second derivative is made of; n counts reward and dynamics parameters."""

    sensitivities: Sensitivities
    transitions: Transitions
    adjoint: Adjoint
    local_jacobian: FloatArray
    discount: float


def covariance_sum(policy: FloatArray, by_q: FloatArray, weights: FloatArray) -> FloatArray:
    """(n, n) sum_s weights(s) Cov_{a ~ policy(s)} of dQ(s, a)."""
    mean = np.einsum("sa,san->sn", policy, by_q)
    centred = (by_q - mean[:, None, :]).reshape(-1, by_q.shape[2])
    share = (policy * weights[:, None]).reshape(-1, 1)
    return np.asarray((centred * share).T @ centred)


def dynamics_terms(parts: CurvatureParts, theta: FloatArray, n_features: int) -> FloatArray:
    """(n, n) the terms lambda T_Qtheta dQ (both sides) and lambda T_thetatheta."""
    model = parts.transitions.model
    weights = parts.discount * parts.adjoint.reward_gradient.ravel()[model.row]
    carrier = scipy.sparse.csr_array(
        (weights, (model.local_index, model.successor)),
        shape=(len(parts.local_jacobian), model.n_states),
    )
    cross = parts.local_jacobian.T @ (carrier @ parts.sensitivities.by_value)
    table = np.zeros((cross.shape[1],) * 2)
    table[n_features:] += cross
    table[:, n_features:] += cross.T
    by_local = model.gather(parts.adjoint.entry_gradient)
    table[n_features:, n_features:] += model.local_curvature(theta, by_local)
    return table
