"""One objective with its gradient against the thesis's own computation.

The 20 x 20 gridworld of section 4.6.2 has 2 weights and 45 outcome parameters, the hallway 3 and
20. All are cold starts unless stated otherwise. The thesis's computation is soft value iteration
and then the soft Q-gradient recursion (4.21), each to the same certified accuracy of 1e-9; its LU
is that of Table 4.2. Times are processor times of one thread.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lab.benchmarks.report import Row, best_of, save
from lab.estimators.forward_gradients import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
    q_gradient_by_lu,
)
from lab.estimators.value_iteration import ValueIteration
from lab.experiments.gridworld.landscape import generated_landscape
from lab.experiments.gridworld.problem import N_OUTCOMES, gridworld, true_dynamics
from serd_core.arrays import FloatArray
from serd_core.demonstrations.observations import observe
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.transition_model import transitions_at
from serd_core.learners.start import starting_parameters
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import MdcePolicy, soft_policy
from serd_core.posterior.posterior import Posterior
from serd_core.priors.prior import UniformPrior
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import load_scenario

ACCURACY = 1e-9
WEIGHTS = np.array([6.0, 6.0])
#: The thesis's dynamics, one part in a hundred of them uniform so that every outcome can happen.
DYNAMICS = 0.99 * true_dynamics() + 0.01 / N_OUTCOMES
HALLWAY_WEIGHTS = np.array([6.0, 1.0, -0.5])
HALLWAY_DYNAMICS = np.array(
    [
        [0.05, 0.85, 0.04, 0.02, 0.04],
        [0.5, 0.3, 0.08, 0.04, 0.08],
        [0.2, 0.6, 0.08, 0.04, 0.08],
        [0.8, 0.05, 0.05, 0.05, 0.05],
    ]
)


def run() -> None:
    """Measure the gradients of both problems."""
    hallway = navigation_problem_of(load_scenario("hallway"), 0.99)
    anywhere = np.full(hallway.mdp.n_states, 1.0 / hallway.mdp.n_states)
    world = gridworld(
        generated_landscape(20, np.random.default_rng([0, 2, 0])), 0.99, goal_at_left=False
    )
    rows = [
        *_gradients("hallway, 176 states", hallway, HALLWAY_WEIGHTS, HALLWAY_DYNAMICS, anywhere),
        *_gradients("gridworld, 400 states", world.problem, WEIGHTS, DYNAMICS, world.starts),
    ]
    save("gradient", "Objective and gradient, cold unless stated otherwise", rows)


def _gradients(
    name: str, problem: Problem, weights: FloatArray, truth: FloatArray, starts: FloatArray
) -> list[Row]:
    policy = soft_policy(problem, weights, truth).probabilities
    rng = np.random.default_rng(0)
    decisions = sample_decisions(
        problem.mdp, policy, truth, starts, n_episodes=25, n_steps=40, rng=rng
    )
    posterior = Posterior(problem, observe(problem, decisions), MdcePolicy(), UniformPrior())
    dynamics = estimate_dynamics(problem, decisions)
    parameters = starting_parameters(problem, posterior.policy_model, weights, dynamics)
    found = posterior.evaluate(parameters)
    value = found.solution.value
    believed = transitions_at(problem.mdp.transitions, parameters.belief)
    slow = ValueIteration(accuracy=ACCURACY)

    def immediate() -> FloatArray:
        jacobian = entry_jacobian(problem.mdp, parameters.belief)
        return immediate_gradient(problem.mdp, problem.features, value, jacobian)

    policy, constant = found.solution.policy, immediate()
    ways: dict[str, Callable[[], object]] = {
        "serd_core": lambda: posterior.evaluate(parameters),
        "serd_core, values known": lambda: posterior.evaluate(parameters, value),
        "soft value iteration": lambda: replace(posterior, solver=slow).solved(parameters),
        "Q-gradient recursion, values known": lambda: q_gradient_by_iteration(
            problem.mdp, believed, policy, constant, accuracy=ACCURACY
        ),
        "Q-gradient by LU, values known": lambda: q_gradient_by_lu(
            problem.mdp, believed, policy, constant
        ),
    }
    seconds = {way: best_of(work, calls=3)[0] for way, work in ways.items()}
    seconds["thesis: value iteration and recursion"] = (
        seconds["soft value iteration"] + seconds["Q-gradient recursion, values known"]
    )
    return [
        {"problem": name, "way": way, "ms": 1e3 * s, "times serd_core": s / seconds["serd_core"]}
        for way, s in seconds.items()
    ]
