"""The score of a decision: the gradient of log pi(a|s) + log P(s'|s,a) by all parameters."""

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.demonstrations.observations import Observations
from serd_core.derivatives.log_transitions import transition_jacobian
from serd_core.derivatives.posterior_hessian import curvature_parts
from serd_core.posterior.parameters import Block, Parameters
from serd_core.posterior.posterior import Posterior, PosteriorValue


def decision_scores(
    posterior: Posterior,
    parameters: Parameters,
    at: PosteriorValue,
    observations: Observations,
) -> tuple[FloatArray, FloatArray]:
    """(G, blocks) score of each distinct observed (s, a, s'), and (G,) how often it was seen."""
    model = posterior.problem.mdp.transitions
    policy_model, q = posterior.policy_model, at.solution.q
    by_q = curvature_parts(posterior, parameters, at).sensitivities.by_q
    policy = np.exp(policy_model.log_probabilities(parameters.policy, q))
    mean = np.einsum("sa,san->sn", policy, by_q)
    state, action = np.divmod(model.groups.row[observations.group], model.n_actions)
    temperature = policy_model.temperature(parameters.policy)
    scores = np.zeros((len(state), len(parameters.vector)))
    scores[:, : by_q.shape[2]] = (by_q[state, action] - mean[state]) / temperature
    if len(parameters.policy):
        for row, pair in enumerate(zip(state, action, strict=True)):
            single = np.zeros_like(q)
            single[pair] = 1.0
            scores[row, parameters.place(Block.POLICY)] = policy_model.parameter_gradient(
                parameters.policy, q, single
            )
    scores[:, parameters.place(Block.TRUTH)] += _transition_scores(posterior, parameters)
    return scores, observations.group_count


def _transition_scores(posterior: Posterior, parameters: Parameters) -> FloatArray:
    model, group = posterior.problem.mdp.transitions, posterior.observations.group
    local = model.local_probabilities(parameters.truth)
    probability = model.groups.probabilities(model.entries(local))[group]
    wanted = np.zeros(len(model.groups), dtype=np.bool_)
    wanted[group] = True
    slopes = transition_jacobian(model, model.local_jacobian(parameters.truth), wanted)
    return np.asarray(slopes / probability[:, None])


def score_sizes(posterior: Posterior, parameters: Parameters, at: PosteriorValue) -> FloatArray:
    """(blocks,) largest of the numbers whose differences make a decision's score, by parameter."""
    model, policy_model = posterior.problem.mdp.transitions, posterior.policy_model
    temperature = policy_model.temperature(parameters.policy)
    by_q = curvature_parts(posterior, parameters, at).sensitivities.by_q
    by_choice = np.abs(by_q).max(axis=(0, 1)) / temperature
    by_outcome = np.abs(model.local_jacobian(parameters.truth)).max(axis=0, initial=0.0)
    largest_q = float(np.abs(at.solution.q[np.isfinite(at.solution.q)]).max())
    by_temperature = np.full(len(parameters.policy), largest_q / temperature**2)
    return np.concatenate([by_choice, by_outcome, by_temperature])
