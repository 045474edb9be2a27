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
expected, and add the covariance of their scores (`serd_core.posterior.posterior`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, IntArray
from serd_core.bellman.bellman_solver import Adjoint, BellmanSolution, policy_system
from serd_core.checks import require_memory
from serd_core.dynamics.transition_model import (
    TransitionModel,
    Transitions,
    log_transition_hessian,
    transition_jacobian,
    transition_probabilities,
    transitions_at,
)
from serd_core.mdp.mdp import Mdp
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue, covariance_of_scores

#: Tables of the size of a derivative that exist at a time.
COPIES = 4
#: Numbers of dQ/dtheta that exist at a time in the sum over states; they stay in the cache.
CHUNK = 250_000


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of V and Q by n numbers: reward weights, then dynamics parameters.

    by_value: (S, n); features: (S, A, F), 0 where unavailable; by_local: (S*A, L) derivatives of Q
    by the local probabilities at V; local_jacobian: (L, n - F) of these.
    """

    by_value: FloatArray
    features: FloatArray
    by_local: Any
    local_jacobian: FloatArray
    transitions: Transitions
    discount: float

    @cached_property
    def by_q(self) -> FloatArray:
        """(S, A, n), zero where an action is unavailable."""
        n_pairs, n_derivatives = self.by_local.shape[0], self.by_value.shape[1]
        _require_memory(n_derivatives, f"{n_pairs} pairs (s, a)", n_pairs)
        return self.by_q_of(np.arange(len(self.by_value)))

    def by_q_of(self, states: IntArray) -> FloatArray:
        """(k, A, n) the same of (k,) states."""
        n_actions, n_features = self.features.shape[1:]
        rows = (states[:, None] * n_actions + np.arange(n_actions)).ravel()
        table = self.discount * (self.transitions.matrix[rows] @ self.by_value)
        table[:, n_features:] += self.by_local[rows] @ self.local_jacobian
        by_q: FloatArray = table.reshape(len(states), n_actions, table.shape[1])
        by_q[:, :, :n_features] += self.features[states]
        return by_q


def sensitivities(
    mdp: Mdp,
    features: FloatArray,
    transitions: Transitions,
    solution: BellmanSolution,
    local_jacobian: FloatArray,
) -> Sensitivities:
    """Derivatives by reward weights, then dynamics parameters."""
    model, discount = transitions.model, mdp.discount
    n_derivatives = features.shape[2] + local_jacobian.shape[1]
    _require_memory(n_derivatives, f"{model.n_states} states", model.n_states)
    policy, n_local = solution.policy, len(local_jacobian)
    numbers = discount * solution.value[model.successor]
    rows, states = model.row_start, model.row_start[:: model.n_actions]
    shape = policy.size, n_local
    by_local = scipy.sparse.csr_array((numbers, model.local_index, rows), shape=shape)
    taken, shape = numbers * policy.ravel()[model.row], (model.n_states, n_local)
    chosen = scipy.sparse.csr_array((taken, model.local_index, states), shape=shape)
    usable = features
    if not model.available.all():
        usable = np.where(model.available[..., None], features, 0.0)
    by_reward = np.einsum("sa,saf->sf", policy, usable)
    system = policy_system(transitions, policy, discount, n_derivatives)
    by_value = system.solve(np.concatenate([by_reward, chosen @ local_jacobian], axis=1))
    return Sensitivities(by_value, usable, by_local, local_jacobian, transitions, discount)


def _require_memory(n_derivatives: int, where: str, rows: int) -> None:
    require_memory(
        f"second derivatives by {n_derivatives} parameters over {where}",
        COPIES * 8.0 * rows * n_derivatives,
        "fit by Lbfgs() with a prior that is given, or learn fewer parameters",
    )


def covariance_sum(policy: FloatArray, by_q: FloatArray, weights: FloatArray) -> FloatArray:
    """(n, n) sum_s weights(s) Cov_{a ~ policy(s)} of dQ(s, a)."""
    mean = np.einsum("sa,san->sn", policy, by_q)
    centred = (by_q - mean[:, None, :]).reshape(-1, by_q.shape[2])
    share = (policy * weights[:, None]).reshape(-1, 1)
    return np.asarray((centred * share).T @ centred)


#: Share, squared, of what a weight moves of Q, up to which it moves no choice beyond rounding.
NO_CHOICE = 1e-20
#: Eigenvalue of the correlation form up to which a direction moves no choice.
NO_MOVE = 1e-9


def idle_weights(posterior: Posterior, parameters: Parameters, at: PosteriorValue) -> FloatArray:
    """(g, F) directions of the weights that change no choice in states where one was made.

    Their parts are in the standard errors that each weight would have if the others were known.
    """
    found = sensitivities_at(posterior, parameters, at, learns_dynamics=False)
    log_policy = posterior.policy_model.log_probabilities(parameters.policy, at.solution.q)
    visits = at.expected.observations.state_action.sum(axis=1)
    information = covariance_sum(np.exp(log_policy), found.by_q, visits)
    most = visits.sum() * np.abs(found.by_q).max(axis=(0, 1)) ** 2
    own = np.diag(information)
    scale = np.sqrt(np.where(own > NO_CHOICE * most, own, np.where(most > 0, most, 1.0)))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    return np.asarray(vectors.T[values <= NO_MOVE])


def dynamics_terms(found: Sensitivities, adjoint: Adjoint, theta: FloatArray) -> FloatArray:
    """(n, n) the terms lambda T_Qtheta dQ (both sides), and lambda T_thetatheta."""
    model, n_features = found.transitions.model, found.features.shape[2]
    weights = found.discount * adjoint.reward_gradient.ravel()[model.row]
    carrier = scipy.sparse.csr_array(
        (weights, (model.local_index, model.successor)),
        shape=(len(found.local_jacobian), model.n_states),
    )
    cross = found.local_jacobian.T @ (carrier @ found.by_value)
    table = np.zeros((cross.shape[1],) * 2)
    table[n_features:] += cross
    table[:, n_features:] += cross.T
    if found.local_jacobian.shape[1]:
        table[n_features:, n_features:] += model.local_curvature(theta, adjoint.local_gradient)
    return table


def posterior_hessian(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    found: Sensitivities | None = None,
    *,
    learns_dynamics: bool = True,
) -> FloatArray:
    """(n, n) second derivatives by all blocks in a row (`Parameters.vector`).

    found: those of the same point where the caller has them. learns_dynamics: whether derivatives
    by dynamics are wanted; otherwise their likelihood's are left out.
    """
    model = posterior.problem.mdp.transitions
    table = posterior.prior.hessian(model, parameters)
    truth = parameters.place(Block.TRUTH)
    seen = at.expected.observations
    if learns_dynamics:
        counts = seen.counts(model)
        table[truth, truth] += log_transition_hessian(model, parameters.truth, counts)
        if seen.dwells is not None:
            table[truth, truth] += seen.dwells.hessian(parameters.truth)
    if found is None:
        found = sensitivities_at(posterior, parameters, at, learns_dynamics=learns_dynamics)
    _add_policy_part(table, posterior, parameters, at, found)
    if seen.hidden:
        scores = transition_scores(posterior, parameters, at, found)
        table += covariance_of_scores(at.expected, scores)
    return table


def vector_hessian(
    belief: Belief, blocks: FloatArray, gradient: Parameters, parameters: Parameters
) -> FloatArray:
    """(m, m) the same by the numbers that the belief leaves free."""
    jacobian = belief.jacobian(parameters)
    table = jacobian.T @ blocks @ jacobian
    n_policy = len(parameters.policy)
    if n_policy:
        last = np.arange(len(table) - n_policy, len(table))
        table[last, last] += gradient.policy * parameters.policy
    return np.asarray((table + table.T) / 2.0)


def sensitivities_at(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    *,
    learns_dynamics: bool = True,
) -> Sensitivities:
    """What both the Hessian and the scores need, by dynamics only where these are learned."""
    mdp = posterior.problem.mdp
    believed = transitions_at(mdp.transitions, parameters.belief)
    if learns_dynamics:
        local_jacobian = mdp.transitions.local_jacobian(parameters.belief)
    else:
        local_jacobian = np.zeros((believed.local_probabilities.size, 0))
    return sensitivities(mdp, posterior.features, believed, at.solution, local_jacobian)


def _add_policy_part(
    table: FloatArray,
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    found: Sensitivities,
) -> None:
    model, counts = posterior.policy_model, at.expected.observations.state_action
    policy = np.exp(model.log_probabilities(parameters.policy, at.solution.q))
    temperature = model.temperature(parameters.policy)
    weights = -counts.sum(axis=1) / temperature**2
    if model.equation.curved:
        # Experts of a soft equation choose by the policy of its solution.
        weights += at.adjoint.state_gradient
    inner = dynamics_terms(found, at.adjoint, parameters.belief)
    size = len(inner)
    states = np.arange(len(policy))
    for chunk in np.array_split(states, 1 + len(states) * policy.shape[1] * size // CHUNK):
        inner += covariance_sum(policy[chunk], found.by_q_of(chunk), weights[chunk])
    # Reward and belief are the first two blocks of the row.
    table[:size, :size] += inner
    if len(parameters.policy):
        last = len(table) - 1
        cross, diagonal = model.parameter_curvature(parameters.policy, at.solution.q, counts)
        seen = np.flatnonzero(counts.any(axis=1))
        mixed = np.tensordot(cross[seen], found.by_q_of(seen), axes=2)
        table[last, :size] += mixed
        table[:size, last] += mixed
        table[last, last] += diagonal


def transition_scores(
    posterior: Posterior, parameters: Parameters, at: PosteriorValue, found: Sensitivities
) -> FloatArray:
    """(G, blocks) scores of the observed transitions, in the order of `Observations.key`."""
    model, key = posterior.problem.mdp.transitions, at.expected.observations.key
    state, action = np.divmod(key // model.n_states, model.n_actions)
    scores = choice_scores(posterior, parameters, at, found, state, action)
    scores[:, parameters.place(Block.TRUTH)] += outcome_scores(model, parameters.truth, key)
    return scores


def choice_scores(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    found: Sensitivities,
    state: IntArray,
    action: IntArray,
) -> FloatArray:
    """(n, blocks) gradients of log pi(a | s) of (n,) choices by all parameters."""
    policy_model, q, by_q = posterior.policy_model, at.solution.q, found.by_q
    policy = np.exp(policy_model.log_probabilities(parameters.policy, q))
    mean = np.einsum("sa,san->sn", policy, by_q)
    temperature = policy_model.temperature(parameters.policy)
    scores = np.zeros((len(state), len(parameters.vector)))
    scores[:, : by_q.shape[2]] = (by_q[state, action] - mean[state]) / temperature
    by_temperature = policy_model.parameter_scores(parameters.policy, q)
    scores[:, parameters.place(Block.POLICY)] = by_temperature[state, action]
    return scores


def outcome_scores(model: TransitionModel, truth: FloatArray, key: IntArray) -> FloatArray:
    """(n, N) gradients of log P(s' | s, a) of (n,) transitions, by the dynamics."""
    group = model.groups.places(key)
    slopes = transition_jacobian(model, truth, group)
    return np.asarray(slopes / transition_probabilities(model, truth)[group, None])
