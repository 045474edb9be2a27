"""One objective with its gradient against the thesis's own computation, and whole fits.

The 20 x 20 gridworld of section 4.6.2 has 2 weights and 45 outcome parameters, the hallway 3 and
20. All are cold starts unless stated otherwise. The thesis's computation is soft value iteration
and then the soft Q-gradient recursion (4.21), each to the same certified accuracy of 1e-9; its LU
is that of Table 4.2. Times are processor times of one thread.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lab.benchmarks.learning.gridworld_problems import (
    WEIGHTS,
    demonstrations,
    landscape_problem,
    objective_of,
)
from lab.benchmarks.report import Row, best_of, save
from lab.estimators.forward_gradients import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
    q_gradient_by_lu,
)
from lab.estimators.value_iteration import ValueIteration
from serd_core.arrays import FloatArray
from serd_core.ascent.ascent import Ascent, Lbfgs
from serd_core.ascent.trust_region import TrustRegion
from serd_core.bayes.laplace import laplace, laplace_draws, posterior_policy
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.estimation import estimate_dynamics
from serd_core.dynamics.transition_model import transitions_at
from serd_core.learners.fit_result import FitResult
from serd_core.learners.mdce_irl import weights_under_initial_dynamics
from serd_core.learners.serd import fit_mdce_serd
from serd_core.learners.start import starting_parameters
from serd_core.mdp.problem import Problem
from serd_core.policies.solved_policy import soft_policy
from serd_sim.scenario.grid import navigation_problem_of
from serd_sim.scenario.scenario import load_scenario

ACCURACY = 1e-9
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
    """Measure the gradients of both problems and whole fits of the gridworld."""
    hallway = navigation_problem_of(load_scenario("hallway"), 0.99)
    world = landscape_problem(20, 0.99)
    seen = demonstrations(world, 25, 40)
    rows = [
        *_gradients("hallway, 176 states", hallway, HALLWAY_WEIGHTS, _in_hallway(hallway)),
        *_gradients("gridworld, 400 states", world.problem, WEIGHTS, seen),
    ]
    save("gradient", "Objective and gradient, cold unless stated otherwise", rows)
    save(
        "fit", "SERD on the gridworld: 2 weights, 45 outcome parameters", _fits(world.problem, seen)
    )


def _gradients(name: str, problem: Problem, weights: FloatArray, decisions: Decisions) -> list[Row]:
    posterior, dynamics = objective_of(problem, decisions), estimate_dynamics(problem, decisions)
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


def _fits(problem: Problem, decisions: Decisions) -> list[Row]:
    """Whole fits, with the start that the experiments use: weights under the initial dynamics."""

    def fit(ascent: Ascent) -> FitResult:
        start = weights_under_initial_dynamics(problem, decisions)
        return fit_mdce_serd(problem, decisions, initial_weights=start, ascent=ascent)

    rows: list[Row] = []
    for name, ascent in (("trust region", TrustRegion()), ("L-BFGS", Lbfgs())):
        seconds, found = best_of(lambda ascent=ascent: fit(ascent), calls=2)  # type: ignore[misc]
        rows.append(_row(f"{name}, no prior", seconds, found))
    seconds, found = best_of(lambda: fit_mdce_serd(problem, decisions), calls=2)
    rows.append(_row("priors by evidence, the default", seconds, found))
    draw_s, _ = best_of(lambda: _summary(problem, decisions, found), calls=2)
    rows.append({"ascent": "Laplace's posterior: intervals and averaged policy", "s": draw_s})
    return rows


def _summary(problem: Problem, decisions: Decisions, fit: FitResult) -> FloatArray:
    """What a command shows of the posterior."""
    draws = laplace_draws(laplace(problem, decisions, fit), np.random.default_rng(0))
    np.quantile(draws.outcome_probabilities, [0.05, 0.95], axis=0)
    return posterior_policy(problem, draws)


def _row(name: str, seconds: float, found: FitResult) -> Row:
    return {
        "ascent": name,
        "s": seconds,
        "steps": found.n_steps,
        "evaluations": found.n_evaluations,
        "message": found.message,
        "log posterior per decision": found.objective / found.n_decisions,
        "largest gradient": found.gradient_norm,
    }


def _in_hallway(problem: Problem) -> Decisions:
    policy = soft_policy(problem, HALLWAY_WEIGHTS, HALLWAY_DYNAMICS).probabilities
    start = np.full(problem.mdp.n_states, 1.0 / problem.mdp.n_states)
    rng = np.random.default_rng(0)
    return sample_decisions(
        problem.mdp, policy, HALLWAY_DYNAMICS, start, n_episodes=20, n_steps=40, rng=rng
    )
