"""Second derivatives of the log posterior by all parameters."""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.derivatives.log_transitions import log_transition_hessian
from serd_core.derivatives.policy_hessian import CurvatureParts, covariance_sum, dynamics_terms
from serd_core.derivatives.sensitivities import sensitivities
from serd_core.dynamics.transitions import transitions_at
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue


def posterior_hessian(
    posterior: Posterior, parameters: Parameters, at: PosteriorValue
) -> FloatArray:
    """(n, n) second derivatives by all blocks in a row (`Parameters.vector`)."""
    model = posterior.problem.mdp.transitions
    table = posterior.prior.hessian(model, parameters)
    truth = parameters.place(Block.TRUTH)
    counts = np.zeros(len(model.groups))
    counts[posterior.observations.group] = posterior.observations.group_count
    table[truth, truth] += log_transition_hessian(model, parameters.truth, counts)
    parts = curvature_parts(posterior, parameters, at)
    _add_policy_part(table, posterior, parameters, at, parts)
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
    data = mdp.policy_pattern.system_data(at.solution.policy, believed.entries, mdp.discount)
    local_jacobian = mdp.transitions.local_jacobian(parameters.belief)
    found = sensitivities(
        posterior.problem.features,
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
    model, counts = posterior.policy_model, posterior.observations.state_action
    by_q, n_features = parts.sensitivities.by_q, len(parameters.reward)
    policy = np.exp(model.log_probabilities(parameters.policy, at.solution.q))
    temperature = model.temperature(parameters.policy)
    inner = dynamics_terms(parts, parameters.belief, n_features)
    inner -= covariance_sum(policy, by_q, counts.sum(axis=1)) / temperature**2
    if model.equation.curved:
        inner += covariance_sum(at.solution.policy, by_q, parts.adjoint.state_gradient)
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
