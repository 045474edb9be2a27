"""One objective with its gradient: the adjoint against the thesis's Q-gradients (4.21).

All start from the same Bellman solution, on the hallway and on a square grid of 400 cells with the
hallway's models; the accuracy of the recursion is the same as that of the direct solve (1e-9).
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.report import Row, save
from serd_core.dynamics.transitions import transitions_at
from serd_core.estimation import estimate_dynamics
from serd_core.gradients.forward import (
    entry_jacobian,
    immediate_gradient,
    q_gradient_by_iteration,
    q_gradient_by_lu,
)
from serd_core.grid import Action, Grid
from serd_core.learners.serd import SerdSettings, starting_parameters
from serd_core.likelihood.observations import observe
from serd_core.navigation import NavigationProblem, build_navigation_problem
from serd_core.policies.mdce import MdcePolicy
from serd_core.policies.solved_policy import soft_policy
from serd_core.posterior import Posterior
from serd_core.priors.prior import UniformPrior
from serd_core.simulation import sample_decisions
from sim.scenario import load_scenario
from sim.scenario_grid import navigation_problem_of

_TRUTH = np.array(
    [
        [0.05, 0.85, 0.04, 0.02, 0.04],
        [0.5, 0.3, 0.08, 0.04, 0.08],
        [0.2, 0.6, 0.08, 0.04, 0.08],
        [0.8, 0.05, 0.05, 0.05, 0.05],
    ]
)
_WEIGHTS = np.array([6.0, 1.0, -0.5])


def run() -> None:
    """Measure both problems."""
    rows: list[Row] = []
    for name, problem in (
        ("hallway", navigation_problem_of(load_scenario("hallway"), 0.99)),
        ("20 x 20 grid", _square(20)),
    ):
        rows += _compare(name, problem)
    save("gradient", "One gradient of the log posterior, milliseconds", rows)


def _compare(name: str, problem: NavigationProblem) -> list[Row]:
    rng = np.random.default_rng(0)
    solution = soft_policy(problem, _WEIGHTS, _TRUTH)
    start = np.full(problem.grid.n_states, 1.0 / problem.grid.n_states)
    decisions = sample_decisions(
        problem.mdp, solution.probabilities, _TRUTH, start, n_episodes=20, n_steps=40, rng=rng
    )
    parameters = starting_parameters(
        problem, MdcePolicy(), _WEIGHTS, estimate_dynamics(problem, decisions)
    )
    settings = SerdSettings()
    posterior = Posterior(
        problem,
        observe(problem.mdp, decisions),
        MdcePolicy(),
        UniformPrior(),
        settings.solver,
        settings.linear_solver,
    )
    found = posterior.evaluate(parameters).solution
    believed = transitions_at(problem.mdp.transitions, parameters.belief)
    immediate = immediate_gradient(
        problem.mdp,
        problem.features,
        found.value,
        entry_jacobian(problem.mdp, parameters.belief),
    )
    adjoint_ms = _milliseconds(lambda: posterior.evaluate(parameters, found.value))
    rows: list[Row] = []
    for way, work in (
        ("Bellman check and adjoint", lambda: posterior.evaluate(parameters, found.value)),
        ("Bellman from nothing and adjoint", lambda: posterior.evaluate(parameters)),
        (
            "Q-gradient by LU (Table 4.2)",
            lambda: q_gradient_by_lu(problem.mdp, believed, found.policy, immediate),
        ),
        (
            "Q-gradient by iteration (Table 4.2)",
            lambda: q_gradient_by_iteration(
                problem.mdp, believed, found.policy, immediate, accuracy=1e-9
            ),
        ),
    ):
        ms = _milliseconds(work)
        rows.append(
            {
                "problem": f"{name}, {problem.grid.n_states} states",
                "way": way,
                "ms": ms,
                "times the adjoint": ms / adjoint_ms,
            }
        )
    return rows


def _square(side: int) -> NavigationProblem:
    """An open square with traffic in columns, up and down by turns."""
    grid = Grid((0.0, 0.0), 1.0, np.ones((side, side), dtype=bool))
    flow = np.where(grid.cells[:, 1] % 4 < 2, Action.NORTH, Action.SOUTH)
    return build_navigation_problem(
        grid=grid,
        flow=flow,
        goal_states=[grid.n_states - 1],
        wall_distance_m=np.full(grid.n_states, 1.0),
        discount=0.99,
    )


def _milliseconds(work: Callable[[], object], at_least_s: float = 0.5) -> float:
    """Best of repeated calls."""
    times, began_s = [], time.perf_counter()
    while time.perf_counter() - began_s < at_least_s or len(times) < 3:
        start_s = time.perf_counter()
        work()
        times.append(time.perf_counter() - start_s)
    return 1e3 * min(times)
