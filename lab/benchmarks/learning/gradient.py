"""One objective with its gradient against the thesis's own computation.

The 20 x 20 gridworld of section 4.6.2 has 2 weights and 45 outcome parameters. All are cold starts
unless stated otherwise. The thesis's computation is soft value iteration and then the soft
Q-gradient recursion (4.21), each to the same certified accuracy of 1e-9; its LU is that of Table
4.2. Times are processor times of one thread.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

import serd_core as sc
from lab.benchmarks.report import best_of, save
from lab.estimators.forward_gradients import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
    q_gradient_by_lu,
)
from lab.estimators.value_iteration import ValueIteration
from lab.experiments.gridworld.landscape import generated_landscape
from lab.experiments.gridworld.problem import N_OUTCOMES, gridworld, true_dynamics
from serd_core.demonstrations.observations import observe
from serd_core.dynamics.transition_model import transitions_at
from serd_core.learners.start import starting_parameters
from serd_core.policies.solved_policy import MdcePolicy
from serd_core.posterior.posterior import Posterior

ACCURACY = 1e-9
WEIGHTS = np.array([6.0, 6.0])
#: The thesis's dynamics, one part in a hundred of them uniform so that every outcome can happen.
DYNAMICS = 0.99 * true_dynamics() + 0.01 / N_OUTCOMES


def run() -> None:
    """Measure one gradient in five ways."""
    landscape = generated_landscape(20, np.random.default_rng([0, 2, 0]))
    world = gridworld(landscape, 0.99, goal_at_left=False)
    problem, mdp = world.problem, world.problem.mdp
    expert = sc.soft_policy(problem, WEIGHTS, DYNAMICS).probabilities
    decisions = sc.sample_decisions(
        mdp, expert, DYNAMICS, world.starts, n_episodes=25, n_steps=40, rng=np.random.default_rng(0)
    )
    posterior = Posterior(problem, observe(problem, decisions), MdcePolicy(), sc.UniformPrior())
    dynamics = sc.estimate_dynamics(problem, decisions)
    parameters = starting_parameters(problem, posterior.policy_model, WEIGHTS, dynamics)
    solution = posterior.evaluate(parameters).solution
    believed = transitions_at(mdp.transitions, parameters.belief)
    jacobian = entry_jacobian(mdp, parameters.belief)
    constant = immediate_gradient(mdp, problem.features, solution.value, jacobian)
    slow = replace(posterior, solver=ValueIteration(accuracy=ACCURACY))
    given = mdp, believed, solution.policy, constant
    ways: dict[str, Callable[[], object]] = {
        "serd_core": lambda: posterior.evaluate(parameters),
        "serd_core, values known": lambda: posterior.evaluate(parameters, solution.value),
        "soft value iteration": lambda: slow.solved(parameters),
        "recursion, values known": lambda: q_gradient_by_iteration(*given, accuracy=ACCURACY),
        "LU, values known": lambda: q_gradient_by_lu(*given),
    }
    seconds = {way: best_of(work, calls=3)[0] for way, work in ways.items()}
    seconds["thesis"] = seconds["soft value iteration"] + seconds["recursion, values known"]
    rows = [
        {"way": way, "ms": 1e3 * s, "times serd_core": s / seconds["serd_core"]}
        for way, s in seconds.items()
    ]
    save("gradient", "Objective and gradient, cold unless stated otherwise", rows)
