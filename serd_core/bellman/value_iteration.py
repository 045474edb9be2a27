"""(Soft) value iteration: V <- T V until the residual certifies the accuracy."""

from dataclasses import dataclass

from serd_core.arrays import FloatArray
from serd_core.bellman.backup import BellmanProblem, backup
from serd_core.bellman.bellman_solver import (
    BellmanSolution,
    BellmanSolver,
    is_accurate,
    require_limits,
    solution_from,
    starting_value,
)


@dataclass(frozen=True)
class ValueIteration(BellmanSolver):
    """Plain sweeps; each shrinks the error by the discount.

    accuracy: wanted error of V relative to max(1, max |V|); max_sweeps bounds the loop.
    """

    accuracy: float = 1e-10
    max_sweeps: int = 1_000_000

    def __post_init__(self) -> None:
        require_limits(self.accuracy, self.max_sweeps)

    def solve(
        self, problem: BellmanProblem, initial_value: FloatArray | None = None
    ) -> BellmanSolution:
        """Sweep until certified or out of sweeps."""
        latest = backup(problem, starting_value(problem.mdp, initial_value))
        sweeps = 1
        while not (done := is_accurate(problem, self.accuracy, latest)):
            if sweeps >= self.max_sweeps:
                break
            latest = backup(problem, latest.target)
            sweeps += 1
        return solution_from(problem, latest, steps=sweeps, linear_solves=0, converged=done)
