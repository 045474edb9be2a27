"""Newton's method for the Bellman equation, which is (soft) policy iteration.

    V <- V + (I - gamma P_pi)^-1 (T V - V),   pi = policy of the present Q

T is convex and monotone, so from the second step on V grows towards V* at least as fast as under
value iteration, and close to V* quadratically. A few value-iteration sweeps before the first step
make a cold start cheaper, and a sweep replaces every step that went wrong numerically. While steps
shrink the residual well, the policy hardly changes, and the next step keeps the last one's matrix.

A step moves the states in which the policy is still wrong by a few transitions only, as it takes
the policy of the values before it: around each goal of a large grid 20 steps are needed where a
few states are left. Where the engine has them, nonlinear Gauss-Seidel sweeps follow the
steps from the first that shrinks the residual too little, soon over these states alone.
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
#: A step that shrinks the residual to this share needs no sweeps after it.
WELL = 0.1
#: Sweeps leave alone what is settled: where nothing near moved by more than this share of the
#: residual before the step.
SETTLED = 1e-2
#: FORCING and KEEP with sweeps: with 1e-2 single states can be so far off that a step is rejected,
#: and a matrix costs a third of a solution.
SWEPT_FORCING, SWEPT_KEEP = 3e-3, 1e-2
#: Residual below which steps converge quadratically and are not swept; the temperature is 1.
QUADRATIC = 0.1


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
        swept, unsettled = problem.engine.sweeps and problem.equation.curved, False
        forcing, keep = (SWEPT_FORCING, SWEPT_KEEP) if swept else (FORCING, KEEP)
        system: LinearSystem | None = None
        solver = self.linear_solver
        while not (done := is_accurate(problem, self.accuracy, latest)) and steps < self.max_steps:
            steps += 1
            if sweeps_due > 0:
                latest, sweeps_due = backup(problem, latest.target), sweeps_due - 1
                continue
            linear_solves += 1
            system = system or _prepared(solver, problem, latest)
            value = latest.value + system.solve(latest.gap, relative_residual=forcing)
            solver = system.solver_of_next(solver)
            if unsettled:
                value = problem.engine.settled(problem, value, SETTLED * latest.residual)
            proposed = backup(problem, value)
            good = proposed.residual <= WELL * latest.residual
            kept = proposed.residual <= keep * latest.residual and not unsettled
            system = system if kept else None
            unsettled = swept and (unsettled or not good) and proposed.residual > QUADRATIC
            if good or _acceptable(proposed, latest):
                latest = proposed
            else:
                latest, sweeps_due = backup(problem, latest.target), self.cold_sweeps
        del system  # frees its memory for the table of Q
        return solution_from(
            problem, latest, steps=steps, linear_solves=linear_solves, converged=done
        )


def _prepared(solver: LinearSolver, problem: BellmanProblem, latest: Backup) -> LinearSystem:
    policy = problem.equation.policy_at(latest.q, latest.target)
    return problem.engine.system(problem.transitions, policy, problem.discount, solver)


def _acceptable(proposed: Backup, latest: Backup) -> bool:
    """Whether a step may be kept: it shrank the residual, or values rose monotonically."""
    if not np.isfinite(proposed.residual):
        return False
    rises = float(np.min(proposed.gap)) >= -FALL * proposed.residual
    return proposed.residual < latest.residual or rises
