"""Newton's method for the Bellman equation, which is (soft) policy iteration.

    V <- V + (I - gamma P_pi)^-1 (T V - V),   pi = policy of the present Q

T is convex and monotone, so from the second step on V grows towards V* at least as fast as under
value iteration, and close to V* quadratically. A few value-iteration sweeps before the first step
make a cold start cheaper, and a sweep replaces every step that went wrong numerically. While steps
shrink the residual well, the policy hardly changes, and the next step keeps the last one's matrix.
"""

from dataclasses import dataclass, field

import numpy as np

from serd_core.arrays import FloatArray, require_kind
from serd_core.bellman.bellman_solver import (
    Backup,
    BellmanProblem,
    BellmanSolution,
    BellmanSolver,
    backup,
    is_accurate,
    policy_system,
    require_limits,
    solution_from,
    starting_value,
)
from serd_core.bellman.linear.automatic import Automatic
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem

#: Relative residual an iterative solver may leave in a correction; the next step removes it. A
#: third fewer products with the matrix than with 1e-3 at 100,000 states.
FORCING = 3e-2
#: Share of the residual by which values may fall in a step that counts as rising.
FALL = 1e-2
#: A step that shrinks the residual to this share was good enough to keep its matrix.
KEEP = 0.03


@dataclass(frozen=True)
class Newton(BellmanSolver):
    """Solves the Bellman equation by Newton's method, safeguarded by sweeps: the default.

    linear_solver: of the system of each step.
    accuracy: wanted error of V relative to max(1, max |V|).
    max_steps: bound of sweeps and Newton steps together; cold_sweeps: sweeps before a cold start.
    """

    linear_solver: LinearSolver = field(default_factory=Automatic)
    accuracy: float = 1e-12
    max_steps: int = 1_000
    cold_sweeps: int = 2

    def __post_init__(self) -> None:
        require_limits(self.accuracy, self.max_steps)
        require_kind("linear_solver", self.linear_solver, (LinearSolver,), "Automatic()")

    def solve(
        self, problem: BellmanProblem, initial_value: FloatArray | None = None
    ) -> BellmanSolution:
        """Solve from `initial_value`, or from zero after `cold_sweeps` sweeps."""
        latest = backup(problem, starting_value(problem.mdp, initial_value))
        sweeps_due = self.cold_sweeps if initial_value is None else 0
        steps, linear_solves = 1, 0
        system: LinearSystem | None = None
        solver = self.linear_solver
        while not (done := is_accurate(problem, self.accuracy, latest)) and steps < self.max_steps:
            steps += 1
            if sweeps_due > 0:
                latest, sweeps_due = backup(problem, latest.target), sweeps_due - 1
                continue
            linear_solves += 1
            system = system or _prepared(solver, problem, latest)
            step = system.solve(latest.gap, relative_residual=FORCING)
            solver = system.solver_of_next(solver)
            proposed = backup(problem, latest.value + step)
            system = system if proposed.residual <= KEEP * latest.residual else None
            if _acceptable(proposed, latest):
                latest = proposed
            else:
                latest, sweeps_due = backup(problem, latest.target), self.cold_sweeps
        return solution_from(
            problem, latest, steps=steps, linear_solves=linear_solves, converged=done
        )


def _prepared(solver: LinearSolver, problem: BellmanProblem, latest: Backup) -> LinearSystem:
    policy = problem.equation.policy_at(latest.q, latest.target)
    return policy_system(problem.transitions, policy, problem.discount, solver)


def _acceptable(proposed: Backup, latest: Backup) -> bool:
    """Whether a step may be kept: it shrank the residual, or values rose monotonically."""
    if not np.isfinite(proposed.residual):
        return False
    rises = float(np.min(proposed.gap)) >= -FALL * proposed.residual
    return proposed.residual < latest.residual or rises
