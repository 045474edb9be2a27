"""What an expert would do after a change of rewards, of the dynamics, or of the choice of actions.

The learned rewards and belief stay as they are where nothing else is given. An expert with a belief
of its own does not react to a change of the true dynamics alone.

    policy = counterfactual_policy(problem, fit, available=without_left_turns)
"""

from dataclasses import replace

import numpy as np

from serd_core.arrays import BoolArray, FloatArray, bool_array
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.sparse_model import KnownEntries, SparseModel, fixed_transitions
from serd_core.dynamics.transition_model import TransitionModel
from serd_core.errors import SerdError
from serd_core.learners.fit_result import FitResult
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import Problem, TabularProblem
from serd_core.policies.solved_policy import Policy, boltzmann_policy, soft_policy


def counterfactual_policy(
    problem: Problem,
    fit: FitResult,
    *,
    reward_weights: FloatArray | None = None,
    outcome_probabilities: FloatArray | None = None,
    available: BoolArray | None = None,
) -> Policy:
    """The expert's policy with these reward weights, believed dynamics and (S, A) actions.

    outcome_probabilities: what the expert believes then. None leaves each as it was learned.
    available: a subset of the actions of the problem.
    """
    changed = problem if available is None else with_actions(problem, available)
    weights = fit.reward_weights if reward_weights is None else reward_weights
    believed = outcome_probabilities
    if believed is None and changed.mdp.transitions.n_parameters:
        believed = fit.believed_outcome_probabilities
    if len(fit.parameters.policy):
        return boltzmann_policy(changed, weights, believed, fit.temperature)
    return soft_policy(changed, weights, believed)


def with_actions(problem: Problem, available: BoolArray) -> TabularProblem:
    """The problem with a subset of its actions; every state keeps at least one."""
    mdp = problem.mdp
    mask = bool_array("available", available, mdp.available.shape)
    if len(added := np.argwhere(mask & ~mdp.available)):
        state, action = added[0]
        raise SerdError(
            f"available must be a subset of the problem's actions, got action {action} of state"
            f" {state}, which has no transitions; build a problem that has it"
        )
    model = _restricted(mdp.transitions, mask)
    return TabularProblem(Mdp(model, mdp.discount), problem.features, problem.feature_names)


def _restricted(model: TransitionModel, mask: BoolArray) -> TransitionModel:
    if isinstance(model, OutcomeModels):
        return replace(model, available=mask)
    if isinstance(model, SparseModel) and isinstance(model.probabilities, KnownEntries):
        kept = mask[model.state, model.action]
        return fixed_transitions(
            model.n_pairs,
            model.state[kept],
            model.action[kept],
            model.next_state[kept],
            model.probabilities.entries[kept],
        )
    raise SerdError(
        "available can be given for OutcomeModels and known transitions, got a"
        f" {type(model).__name__} with functions of its own; build the smaller model"
    )
