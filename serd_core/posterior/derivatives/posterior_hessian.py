"""Second derivatives of the log posterior by all parameters.

Derivatives of V and Q come first, for all parameters at once from one S x S factorisation: the
thesis's Q-gradient (4.21) reduced to states, N right-hand sides of one LU.

    (I - gamma P_pi) dV = sum_a pi (f + gamma dP V),   dQ = f + gamma dP V + gamma P dV

With the Lagrangian J(Q) + lambda . (T(Q, theta) - Q) at the converged Q and its adjoint lambda, the
policy's log-likelihood has by rewards, believed dynamics and temperature

    d2J = dQ^T (J_QQ + lambda T_QQ) dQ + 2 lambda T_Qtheta dQ + lambda T_thetatheta

    J_QQ       = -n(s) / temperature^2 Cov_pi,       T_QQ = y(s) Cov_pi for soft, 0 for hard
    T_Qtheta   = gamma dP dV,                        T_thetatheta = gamma d2P V

where y = gamma P^T lambda is the state part of the adjoint. Moves whose action is hidden count as
expected, and add the covariance of their scores (`serd_core.posterior.hidden_actions`).
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.bellman.linear.linear_solver import LinearSystem
from serd_core.dynamics.transition_model import Transitions, transitions_at
from serd_core.memory import require_memory
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.derivatives.adjoint import Adjoint
from serd_core.posterior.derivatives.scores import transition_scores
from serd_core.posterior.derivatives.transition_derivatives import log_transition_hessian
from serd_core.posterior.hidden_actions import covariance_of_scores
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue

#: Tables of the size of dQ/dtheta that exist at a time.
COPIES = 4


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """by_value: (S, n); by_q: (S, A, n), zero where an action is unavailable."""

    by_value: FloatArray
    by_q: FloatArray


def sensitivities(
    features: FloatArray,
    discount: float,
    transitions: Transitions,
    solution: BellmanSolution,
    local_jacobian: FloatArray,
    system: LinearSystem,
) -> Sensitivities:
    """Derivatives by reward weights, then dynamics parameters."""
    model = transitions.model
    rows = model.available.size
    n_derivatives = features.shape[2] + local_jacobian.shape[1]
    require_memory(
        f"second derivatives by {n_derivatives} parameters over {rows} pairs (s, a)",
        COPIES * 8.0 * rows * n_derivatives,
        "fit by Lbfgs() with a prior that is given, or learn fewer parameters",
    )
    weighted = scipy.sparse.csr_array(
        (discount * solution.value[model.successor], (model.row, model.local_index)),
        shape=(rows, len(local_jacobian)),
    )
    by_dynamics = (weighted @ local_jacobian).reshape(*model.available.shape, -1)
    usable = np.where(model.available[:, :, None], features, 0.0)
    immediate = np.concatenate([usable, by_dynamics], axis=2)
    by_value = system.solve(np.einsum("sa,san->sn", solution.policy, immediate))
    onward = (transitions.matrix @ by_value).reshape(immediate.shape)
    return Sensitivities(by_value=by_value, by_q=immediate + discount * onward)


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
    curvature = model.local_curvature(theta, parts.adjoint.local_gradient)
    table[n_features:, n_features:] += curvature
    return table


def posterior_hessian(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    parts: CurvatureParts | None = None,
) -> FloatArray:
    """(n, n) second derivatives by all blocks in a row (`Parameters.vector`).

    parts: those of the same point where the caller has them.
    """
    model = posterior.problem.mdp.transitions
    table = posterior.prior.hessian(model, parameters)
    truth = parameters.place(Block.TRUTH)
    seen = at.expected.observations
    counts = seen.counts(model)
    table[truth, truth] += log_transition_hessian(model, parameters.truth, counts)
    if parts is None:
        parts = curvature_parts(posterior, parameters, at)
    _add_policy_part(table, posterior, parameters, at, parts)
    if seen.hidden:
        q, by_q = at.solution.q, parts.sensitivities.by_q
        scores = transition_scores(model, posterior.policy_model, parameters, seen.key, q, by_q)
        table += covariance_of_scores(seen, at.expected.share, scores)
    return table


def vector_hessian(
    belief: Belief, blocks: FloatArray, gradient: Parameters, parameters: Parameters
) -> FloatArray:
    """(m, m) the same by the numbers that the belief leaves free.

    The temperature moves by its logarithm, which bends: d2 T / d(log T)^2 = T.
    """
    jacobian = belief.jacobian(parameters)
    table = jacobian.T @ blocks @ jacobian
    n_policy = len(parameters.policy)
    if n_policy:
        last = np.arange(len(table) - n_policy, len(table))
        table[last, last] += gradient.policy * parameters.policy
    return np.asarray((table + table.T) / 2.0)


def curvature_parts(
    posterior: Posterior, parameters: Parameters, at: PosteriorValue
) -> CurvatureParts:
    """Sensitivities and what else both the Hessian and the scores need."""
    mdp = posterior.problem.mdp
    believed = transitions_at(mdp.transitions, parameters.belief)
    data = believed.system_data(mdp.policy_pattern, at.solution.policy, mdp.discount)
    local_jacobian = mdp.transitions.local_jacobian(parameters.belief)
    found = sensitivities(
        posterior.features,
        mdp.discount,
        believed,
        at.solution,
        local_jacobian,
        posterior.linear_solver.prepare(mdp.policy_pattern, data),
    )
    return CurvatureParts(found, believed, at.adjoint, local_jacobian, mdp.discount)


def _add_policy_part(
    table: FloatArray,
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    parts: CurvatureParts,
) -> None:
    model, counts = posterior.policy_model, at.expected.observations.state_action
    by_q, n_features = parts.sensitivities.by_q, len(parameters.reward)
    policy = np.exp(model.log_probabilities(parameters.policy, at.solution.q))
    temperature = model.temperature(parameters.policy)
    inner = dynamics_terms(parts, parameters.belief, n_features)
    weights = -counts.sum(axis=1) / temperature**2
    if model.equation.curved:
        # Experts of a soft equation choose by the policy of its solution.
        weights += parts.adjoint.state_gradient
    inner += covariance_sum(policy, by_q, weights)
    # Reward and belief are the first two blocks of the row.
    size = len(inner)
    table[:size, :size] += inner
    if len(parameters.policy):
        last = len(table) - 1
        cross, diagonal = model.parameter_curvature(parameters.policy, at.solution.q, counts)
        mixed = np.tensordot(cross, by_q, axes=2)
        table[last, :size] += mixed
        table[:size, last] += mixed
        table[last, last] += diagonal
