"""(Soft) value iteration: plain sweeps V <- T V, as in the thesis."""

from dataclasses import dataclass

import numpy as np

from serd_core.arrays import FloatArray
from serd_core.bellman.bellman_solver import (
    BellmanProblem,
    BellmanSolution,
    Newton,
    backup,
    is_accurate,
    solution_from,
)


@dataclass(frozen=True)
class ValueIteration(Newton):
    """Solves the Bellman equation by sweeps, each of which shrinks the error by the discount."""

    accuracy: float = 1e-10
    max_steps: int = 1_000_000

    def solve(
        self, problem: BellmanProblem, initial_value: FloatArray | None = None
    ) -> BellmanSolution:
        value = np.zeros(problem.mdp.n_states) if initial_value is None else initial_value
        latest, steps = backup(problem, value), 1
        while not (done := is_accurate(problem, self.accuracy, latest)) and steps < self.max_steps:
            latest, steps = backup(problem, latest.target), steps + 1
        return solution_from(problem, latest, steps=steps, linear_solves=0, converged=done)
