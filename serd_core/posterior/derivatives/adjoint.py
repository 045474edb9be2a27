"""Gradient by every reward and every transition probability from one transposed solve.

For an objective J with g(s, a) = dJ/dQ(s, a) at the converged Q and the policy pi along which the
equation propagates gradients (Boltzmann for soft, greedy for hard):

    (I - gamma P_pi^T) y = gamma P^T g,    lambda(s, a) = g(s, a) + pi(a | s) y(s)
    dJ/dR(s, a) = lambda(s, a),            dJ/dP(s' | s, a) = gamma lambda(s, a) V(s')

This is the transpose of the Q-gradient (4.21), (4.66) of the thesis: its cost does not grow with
the number of parameters.
"""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.bellman.bellman_solver import BellmanSolution
from serd_core.bellman.linear.linear_solver import LinearSolver
from serd_core.dynamics.transition_model import Transitions
from serd_core.mdp.mdp import Mdp


@dataclass(frozen=True, eq=False)
class Adjoint:
    """dJ/dR as (S, A), dJ/d(local probabilities of P), and the state part y as (S,)."""

    reward_gradient: FloatArray
    local_gradient: FloatArray
    state_gradient: FloatArray


def adjoint(
    mdp: Mdp,
    transitions: Transitions,
    solution: BellmanSolution,
    q_gradient: FloatArray,
    linear_solver: LinearSolver,
) -> Adjoint:
    """Gradient of an objective with the given (S, A) gradient by the converged Q."""
    engine, policy = mdp.engine, solution.policy
    system = engine.system(transitions, policy, mdp.discount, linear_solver)
    flow = engine.flow(transitions, q_gradient)
    state_gradient = system.solve(mdp.discount * flow, transposed=True)
    del system
    reward_gradient = policy * state_gradient[:, None]
    reward_gradient += q_gradient
    by_local = engine.local_gradient(transitions, reward_gradient, solution.value)
    return Adjoint(
        reward_gradient=reward_gradient,
        local_gradient=mdp.discount * by_local,
        state_gradient=state_gradient,
    )
