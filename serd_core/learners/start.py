"""Where a fit starts: line 3 of Algorithm 1, and the reward weights of section 4.6.2."""

import numpy as np

from serd_core.arrays import FloatArray, float_array, number_array, require_generator
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.estimation import estimate_dynamics, outcome_models_of
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior.beliefs import Belief, TiedBelief
from serd_core.posterior.parameters import Parameters

TIED = TiedBelief()
#: Probability of intended outcomes where a fit of hidden actions starts.
INTENDED_SHARE = 0.9


def dynamics_or_estimate(
    problem: Problem, decisions: Decisions, dynamics: FloatArray | None, *, learned: bool = False
) -> FloatArray:
    """The given dynamics, or the M-estimate with a uniform prior (line 3 of Algorithm 1).

    In the terms of the model: an (M, K) table, or the parameters of a SparseModel. A model without
    parameters needs neither. Where actions are hidden, the estimate of dynamics that are `learned`
    is `dynamics_of_hidden_actions`; others must be given.
    """
    model = problem.mdp.transitions
    if dynamics is None and model.n_parameters and decisions.hidden.any():
        if not learned:
            raise SerdError(
                f"action[{np.argmax(decisions.hidden)}] must be known for an estimate of the"
                " dynamics, got a hidden one; pass dynamics, or use a belief that learns them"
            )
        return dynamics_of_hidden_actions(problem, decisions)
    if dynamics is None:
        return estimate_dynamics(problem, decisions) if model.n_parameters else np.zeros(0)
    return np.asarray(number_array("dynamics", dynamics), dtype=np.float64)


def dynamics_of_hidden_actions(problem: Problem, decisions: Decisions) -> FloatArray:
    """(M, K) where a fit of hidden actions starts: the intended outcome of each model is likely.

    Models of pairs (s, a) that decisions show get the M-estimate of these. Without `intended` all
    models get it; SerdError where no decision shows its action.
    """
    model, shown = outcome_models_of(problem.mdp), decisions.select(~decisions.hidden)
    if model.intended is None and not len(shown):
        raise SerdError(
            "dynamics must be given as a start where all actions are hidden, got None; pass a table"
            " in which the intended outcomes are the most likely, or OutcomeModels with `intended`"
        )
    if model.intended is None:
        return estimate_dynamics(problem, shown)
    other = (1.0 - INTENDED_SHARE) / max(model.n_outcomes - 1, 1)
    table = np.full((model.n_models, model.n_outcomes), other)
    table[np.arange(model.n_models), model.intended] = INTENDED_SHARE
    table /= table.sum(axis=1, keepdims=True)
    if len(shown):
        estimate = estimate_dynamics(problem, shown)
        counted = np.unique(model.model_of[shown.state, shown.action])
        table[counted] = estimate[counted]
    return table


def initial_weights_or_sample(
    problem: Problem, initial_weights: FloatArray | None, rng: np.random.Generator | None
) -> FloatArray:
    """The given (F,) weights, or a sample of U[-10, 10] as in section 4.6.2."""
    n_features = len(problem.feature_names)
    if initial_weights is not None:
        return float_array("initial_weights", initial_weights, (n_features,))
    if rng is None:
        raise SerdError("initial_weights or rng must be given, got neither; pass one of them")
    require_generator(rng)
    return rng.uniform(-10.0, 10.0, n_features)


def starting_parameters(
    problem: Problem,
    policy_model: PolicyModel,
    initial_weights: FloatArray,
    dynamics: FloatArray,
    relation: Belief = TIED,
) -> Parameters:
    """All four blocks for given weights and dynamics; belief and truth start equal."""
    model = problem.mdp.transitions
    if relation.learns_dynamics:
        theta = model.parameters_of(dynamics)
    else:
        theta = model.fixed_parameters_of(dynamics)
    model.require_transitions(model.local_probabilities(theta))
    weights = float_array("initial_weights", initial_weights, (len(problem.feature_names),))
    return Parameters(
        reward=weights, belief=theta, truth=theta, policy=policy_model.initial_parameters
    )
