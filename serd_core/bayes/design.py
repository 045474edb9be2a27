"""Which demonstration informs most: expected information gain by the state where it starts.

Near the posterior, a demonstration from s0 under the fitted policy and dynamics has the expected
Fisher information F(s0), and Laplace's approximation of what it is expected to add is

    gain(s0) = 1/2 log det(I + L^T F(s0) L),       posterior covariance = L L^T
    F(s0)    = sum over visited (s, a) of E[score score^T],
    E[score score^T] in s = Cov_{a ~ pi(s)} dQ(s, a) + sum_{a, s'} pi(a|s) dP dP^T / P

in nats: the D-optimal design of Chaloner and Verdinelli (Statistical Science 10, 1995). The first
part is that of choices, the second that of transitions. Sums over visits obey F = G + P_pi F, with
G of one decision in each state, up to the longest demonstration.
"""

import numpy as np
import scipy.sparse

from serd_core.arrays import FloatArray, floored
from serd_core.bayes.laplace import Laplace
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.bellman.linear.automatic import Automatic
from serd_core.dynamics.transition_model import Transitions, transitions_at
from serd_core.errors import SerdError
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import solution_at
from serd_core.posterior.derivatives.posterior_hessian import sensitivities
from serd_core.posterior.derivatives.transition_derivatives import transition_jacobian
from serd_core.posterior.parameters import Block, Parameters

#: Visits of later decisions count as none below this share of the demonstrations.
LEFT = 1e-6


def expected_information_gain(
    found: Laplace, *, task: Problem | None = None, longest: int = 200
) -> FloatArray:
    """(S,) nats that a demonstration from each state is expected to add.

    task: the problem it is made in, such as one with another goal; None for that of the fit. It
    must have the features and outcome models of the fit. longest: decisions of a demonstration.
    """
    problem = found.problem if task is None else task
    _require_same_numbers(found.problem, problem)
    if longest < 1:
        raise SerdError(f"longest must be at least 1 decision, got {longest}")
    information = _information_of_starts(problem, found, longest)
    added = found.root.T @ information @ found.root
    identity = np.eye(added.shape[1])
    return np.asarray(0.5 * np.linalg.slogdet(identity + added)[1])


def _require_same_numbers(fitted: Problem, task: Problem) -> None:
    if fitted.feature_names != task.feature_names:
        raise SerdError(
            f"task must have the features of the fit {fitted.feature_names}, got"
            f" {task.feature_names}"
        )
    ours, theirs = (each.mdp.transitions.parameter_names for each in (fitted, task))
    if ours != theirs:
        raise SerdError(
            f"task must have the outcome models of the fit, {len(ours)} energies, got {len(theirs)}"
        )


def _information_of_starts(problem: Problem, found: Laplace, longest: int) -> FloatArray:
    """(S, d, d) expected information of a demonstration from each state, by coordinates."""
    space, model = found.coordinates, problem.mdp.transitions
    at = space.parameters(found.mode)
    table = space.belief.jacobian(at) @ space.table
    believed, true = (transitions_at(model, each) for each in (at.belief, at.truth))
    solution = solution_at(problem, at.reward, believed)
    policy = solution.policy
    one = _of_choices(problem, at, believed, solution, table)
    one += _of_transitions(true, policy, at, table)
    n_states, size = len(one), one.shape[1]
    weights = policy.ravel()[:, None]
    step = true.matrix.multiply(weights).tocsr()
    pairs = scipy.sparse.kron(
        scipy.sparse.csr_array(scipy.sparse.identity(n_states)), np.ones((1, problem.mdp.n_actions))
    )
    going = (pairs @ step).tocsr()
    remaining = (~problem.mdp.final).astype(np.float64)
    flat = one.reshape(n_states, -1) * remaining[:, None]
    total, left = flat.copy(), remaining.copy()
    for _ in range(longest - 1):
        left = remaining * (going @ left)
        if np.max(left, initial=0.0) < LEFT:
            break
        total = flat + remaining[:, None] * (going @ total)
    return total.reshape(n_states, size, size)


def _of_choices(
    problem: Problem,
    at: Parameters,
    believed: Transitions,
    solution: BellmanSolution,
    table: FloatArray,
) -> FloatArray:
    """(S, d, d) covariance of the derivatives of Q over the actions of a state."""
    mdp, policy = problem.mdp, solution.policy
    by_q = sensitivities(
        problem.features,
        mdp.discount,
        believed,
        solution,
        mdp.transitions.local_jacobian(at.belief),
        mdp.engine.system(believed, policy, mdp.discount, Automatic()),
    ).by_q
    by_u = by_q @ table[: by_q.shape[2]]
    mean = np.einsum("sa,sau->su", policy, by_u)
    root = np.sqrt(policy)[:, :, None] * (by_u - mean[:, None, :])
    return np.asarray(root.transpose(0, 2, 1) @ root)


def _of_transitions(
    true: Transitions, policy: FloatArray, at: Parameters, table: FloatArray
) -> FloatArray:
    """(S, d, d) expected squares of the derivatives of log P(s' | s, a)."""
    model, groups = true.model, true.model.groups
    every = np.ones(len(groups), dtype=np.bool_)
    slopes = transition_jacobian(model, model.local_jacobian(at.truth), every)
    by_u = slopes @ table[at.place(Block.TRUTH)]
    weights = policy.ravel()[groups.row] / floored(groups.probabilities(true.entries))
    root = np.sqrt(weights)[:, None] * by_u
    state = groups.row // model.n_actions
    total = np.zeros((model.n_states, by_u.shape[1], by_u.shape[1]))
    np.add.at(total, state, root[:, :, None] * root[:, None, :])
    return total
