"""Information matrices of a fit, by the numbers that were free.

    observed (Hessian):     -d2 J / d theta2                       (with the prior's part)
    outer product (BHHH):   sum over decisions of score score^T    (likelihood only)

The score of a decision is the gradient of log pi(a|s) + log P(s'|s,a). Both matrices estimate the
same Fisher information for many decisions under a true model; a large difference between them
speaks against the model.
"""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.beliefs import Belief
from serd_core.curvature.log_transitions import transition_jacobian
from serd_core.curvature.posterior_hessian import (
    curvature_parts,
    posterior_hessian,
    vector_hessian,
)
from serd_core.demonstrations import Decisions
from serd_core.fit_result import FitResult
from serd_core.learners.serd import TIED, UNIFORM
from serd_core.likelihood.observations import Observations, observe
from serd_core.parameters import Block, Parameters
from serd_core.policies.mdce import MdcePolicy
from serd_core.policies.policy_model import PolicyModel
from serd_core.posterior import Posterior, PosteriorValue
from serd_core.priors.prior import Prior
from serd_core.problem import Problem
from serd_core.solvers.automatic import Automatic
from serd_core.solvers.newton import Newton

MDCE = MdcePolicy()


@dataclass(frozen=True, eq=False)
class Information:
    """Both information matrices over n free numbers.

    names: (n,); observed, outer_product: (n, n).
    gauge: (g, n) directions that change nothing, such as a constant added to all energies of an
    outcome model. parameters: where they were taken; jacobian: (all blocks, n).
    """

    names: tuple[str, ...]
    observed: FloatArray
    outer_product: FloatArray
    gauge: FloatArray
    parameters: Parameters
    jacobian: FloatArray


def fit_information(
    problem: Problem,
    decisions: Decisions,
    fit: FitResult,
    *,
    policy_model: PolicyModel = MDCE,
    belief: Belief = TIED,
    prior: Prior = UNIFORM,
) -> Information:
    """Information at a fit; pass the policy model, belief and prior it was made with."""
    observations = observe(problem.mdp, decisions)
    whole_prior = (prior + belief.prior).anchored(fit.initial_outcome_probabilities)
    posterior = Posterior(problem, observations, policy_model, whole_prior, Newton(), Automatic())
    at = posterior.evaluate(fit.parameters)
    hessian = posterior_hessian(posterior, fit.parameters, at)
    jacobian = belief.jacobian(fit.parameters)
    scores, counts = decision_scores(posterior, fit.parameters, at, observations)
    free_scores = scores @ jacobian
    return Information(
        names=_free_names(problem, fit.parameters, jacobian),
        observed=-vector_hessian(belief, hessian, at.gradient, fit.parameters),
        outer_product=(free_scores * counts[:, None]).T @ free_scores,
        gauge=_free_gauge(problem, fit.parameters, jacobian),
        parameters=fit.parameters,
        jacobian=jacobian,
    )


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


def _free_names(problem: Problem, parameters: Parameters, jacobian: FloatArray) -> tuple[str, ...]:
    """Name each free number after the blocks it moves."""
    dynamics = problem.mdp.transitions.parameter_names
    rows = [f"reward {name}" for name in problem.feature_names]
    rows += [f"belief {name}" for name in dynamics] + [f"truth {name}" for name in dynamics]
    rows += ["log temperature"] * len(parameters.policy)
    names = []
    for column in jacobian.T:
        moved = [rows[i] for i in np.flatnonzero(column)]
        tied = len(moved) == 2
        names.append(moved[1].replace("truth", "dynamics", 1) if tied else moved[0])
    return tuple(names)


def _free_gauge(problem: Problem, parameters: Parameters, jacobian: FloatArray) -> FloatArray:
    """Gauge directions of each dynamics block in the free numbers, orthonormal rows."""
    gauge = problem.mdp.transitions.gauge
    found = []
    for block in (Block.BELIEF, Block.TRUTH):
        columns = np.any(jacobian[parameters.place(block)] != 0, axis=0)
        if columns.any():
            rows = np.zeros((len(gauge), jacobian.shape[1]))
            rows[:, columns] = gauge
            found.append(rows)
    if not found:
        return np.zeros((0, jacobian.shape[1]))
    # Tied blocks give the same rows twice.
    rows = np.unique(np.concatenate(found), axis=0)
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / lengths)
