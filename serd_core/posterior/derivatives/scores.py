"""Scores of transitions: the gradient of log pi(a | s) + log P(s' | s, a) by all parameters."""

import numpy as np

from serd_core.arrays import FloatArray, IntArray, floored
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.derivatives.transition_derivatives import transition_jacobian
from serd_core.posterior.parameters import Block, Parameters


def transition_scores(
    model: TransitionModel,
    policy_model: PolicyModel,
    parameters: Parameters,
    key: IntArray,
    q: FloatArray,
    by_q: FloatArray,
) -> FloatArray:
    """(G, blocks) score of each transition, for Q and its (S, A, n) derivatives.

    key: (G,) sorted keys of `Observations`.
    """
    policy = np.exp(policy_model.log_probabilities(parameters.policy, q))
    mean = np.einsum("sa,san->sn", policy, by_q)
    state, action = np.divmod(key // model.n_states, model.n_actions)
    temperature = policy_model.temperature(parameters.policy)
    scores = np.zeros((len(state), len(parameters.vector)))
    scores[:, : by_q.shape[2]] = (by_q[state, action] - mean[state]) / temperature
    by_temperature = policy_model.parameter_scores(parameters.policy, q)
    scores[:, parameters.place(Block.POLICY)] = by_temperature[state, action]
    scores[:, parameters.place(Block.TRUTH)] += _outcome_scores(model, parameters.truth, key)
    return scores


def _outcome_scores(model: TransitionModel, truth: FloatArray, key: IntArray) -> FloatArray:
    group = model.groups.places(key)
    entries = model.entries(model.local_probabilities(truth))
    probability = floored(model.groups.probabilities(entries)[group])
    wanted = np.zeros(len(model.groups), dtype=np.bool_)
    wanted[group] = True
    slopes = transition_jacobian(model, model.local_jacobian(truth), wanted)
    return np.asarray(slopes / probability[:, None])
