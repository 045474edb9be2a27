"""Decisions and parameters of random problems, and the checks of their derivatives."""

import numpy as np
from hypothesis import assume

from serd_core.arrays import FloatArray, gradient_differences
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import PolicyModel
from serd_core.posterior.beliefs import Belief
from serd_core.posterior.hessian import posterior_hessian, vector_hessian
from serd_core.posterior.parameters import Parameters
from serd_core.posterior.posterior import Posterior


def uniform_decisions(problem: Problem, table: FloatArray, rng: np.random.Generator) -> Decisions:
    """Ten episodes of at most eight decisions by chance, from anywhere; there may be none."""
    mdp = problem.mdp
    uniform = mdp.available / mdp.available.sum(axis=1, keepdims=True)
    start = np.full(mdp.n_states, 1 / mdp.n_states)
    return sample_decisions(mdp, uniform, table, start, n_episodes=10, n_steps=8, rng=rng)


def random_parameters(
    problem: Problem, policy_model: PolicyModel, rng: np.random.Generator
) -> Parameters:
    """Standard normal numbers, with the policy's own start."""
    n_parameters = problem.mdp.transitions.n_parameters
    return Parameters(
        reward=rng.normal(size=2),
        belief=rng.normal(size=n_parameters),
        truth=rng.normal(size=n_parameters),
        policy=policy_model.initial_parameters,
    )


def pulled_back_gradient(
    posterior: Posterior, belief: Belief, like: Parameters, free: FloatArray
) -> FloatArray:
    """Gradient by the numbers that a belief leaves free."""
    at = belief.unpack(free, like)
    return belief.pull_back(posterior.evaluate(at).gradient, at)


def assume_one_best_action_around(
    posterior: Posterior, belief: Belief, parameters: Parameters
) -> None:
    """Leaves out parameters near which a best action changes: policy matching has a kink there."""
    vector = belief.pack(parameters)

    def best_actions(free: FloatArray) -> list[int]:
        found = posterior.evaluate(belief.unpack(free, parameters))
        return list(np.argmax(found.solution.q, axis=1))

    here = best_actions(vector)
    for unit in np.eye(len(vector)):
        for step in (-1e-4, 1e-4):
            assume(best_actions(vector + step * unit) == here)


def assert_gradient_is_of_the_objective(
    posterior: Posterior, belief: Belief, parameters: Parameters
) -> None:
    """The exact gradient is the difference of the objective."""
    vector, step = belief.pack(parameters), 1e-5

    def value(free: FloatArray) -> float:
        return posterior.evaluate(belief.unpack(free, parameters)).objective

    def slope(unit: FloatArray) -> float:
        """Fourth order, so that rounding and not the step limits it."""
        near, far = (value(vector + k * step * unit) for k in (1, 2))
        back, behind = (value(vector - k * step * unit) for k in (1, 2))
        return (8 * (near - back) - (far - behind)) / (12 * step)

    numeric = np.array([slope(unit) for unit in np.eye(len(vector))])
    scale = max(1.0, np.max(np.abs(numeric)))
    gradient = pulled_back_gradient(posterior, belief, parameters, vector)
    np.testing.assert_allclose(gradient / scale, numeric / scale, rtol=0, atol=1e-6)


def assert_hessian_is_of_the_gradient(
    posterior: Posterior, belief: Belief, parameters: Parameters
) -> None:
    """The exact second derivatives are the differences of the gradient."""
    found = posterior.evaluate(parameters)
    blocks = posterior_hessian(posterior, parameters, found)
    exact = vector_hessian(belief, blocks, found.gradient, parameters)
    numeric = gradient_differences(
        lambda free: pulled_back_gradient(posterior, belief, parameters, free),
        belief.pack(parameters),
    )
    scale = max(1.0, np.max(np.abs(numeric)))
    np.testing.assert_allclose(exact / scale, numeric / scale, atol=3e-6)
