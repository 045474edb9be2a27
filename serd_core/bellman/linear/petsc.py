"""Linear systems of Newton's method and of gradients on several processes, by PETSc over MPI.

Every process runs the same program: `mpiexec -n 2 python program.py`. A process assembles its share
of the rows of I - gamma P_pi, PETSc solves by BiCGSTAB with an incomplete factor of each share
(block Jacobi), and every process receives the whole solution. Problem and values are held by each
process; matrix, factor and vectors of the linear solver are divided among them.

petsc4py is not required by `serd_core`: Debian has it as python3-petsc4py.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from serd_core.arrays import FloatArray
from serd_core.bellman.linear.linear_solver import LinearSolver, LinearSystem
from serd_core.bellman.linear.policy_pattern import PolicyPattern
from serd_core.errors import SerdError


@dataclass(frozen=True)
class Petsc(LinearSolver):
    """BiCGSTAB on all processes of PETSc's world communicator.

    relative_residual: |b - A x| / |b| to reach, unless `solve` allows more; max_iterations: bound.
    """

    relative_residual: float = 1e-12
    max_iterations: int = 10_000

    def prepare(self, pattern: PolicyPattern, data: FloatArray) -> LinearSystem:
        """Assemble the rows of this process and factorise them."""
        n_states, world = pattern.n_states, PETSc.COMM_WORLD
        ends = np.linspace(0, n_states, world.size + 1).astype(np.int64)
        first, last = ends[world.rank : world.rank + 2]
        start = pattern.row_start[first : last + 1].astype(PETSc.IntType)
        mine = slice(start[0], start[-1])
        rows = start - start[0], pattern.column[mine].astype(PETSc.IntType), data[mine]
        sizes = ((last - first, n_states),) * 2
        matrix = PETSc.Mat().createAIJ(sizes, csr=rows, comm=world)
        solver = PETSc.KSP().create(world)
        solver.setOperators(matrix)
        solver.setType(PETSc.KSP.Type.BCGS)
        solver.getPC().setType(PETSc.PC.Type.BJACOBI)
        # The true residual counts, not that of the preconditioned system.
        solver.setPCSide(PETSc.PC.Side.RIGHT)
        return PetscSystem(self, solver, matrix, (int(first), int(last)))


@dataclass(frozen=True, eq=False)
class PetscSystem(LinearSystem):
    """One matrix, of which this process has the rows from first to last - 1."""

    settings: Petsc
    solver: Any
    matrix: Any
    rows: tuple[int, int]

    def solve(
        self, right_side: FloatArray, *, transposed: bool = False, relative_residual: float = 0.0
    ) -> FloatArray:
        """Solve column by column; SerdError where the residual is not reached."""
        target = max(relative_residual, self.settings.relative_residual)
        if right_side.ndim == 1:
            return self._solve_one(right_side, transposed, target)
        columns = [self._solve_one(column, transposed, target) for column in right_side.T]
        return np.stack(columns, axis=1)

    def _solve_one(self, right_side: FloatArray, transposed: bool, target: float) -> FloatArray:
        solution, given = self.matrix.createVecs()
        given.setArray(right_side[slice(*self.rows)])
        self.solver.setTolerances(rtol=target, atol=0.0, max_it=self.settings.max_iterations)
        (self.solver.solveTranspose if transposed else self.solver.solve)(given, solution)
        if self.solver.getConvergedReason() < 0:
            raise SerdError(
                f"Petsc must reach a relative residual of {target}, got"
                f" {self.solver.getResidualNorm() / given.norm()} after"
                f" {self.solver.getIterationNumber()} iterations; raise max_iterations"
            )
        return _whole(solution)


def _whole(vector: Any) -> FloatArray:
    """(S,) a distributed vector, as each process receives it."""
    scatter, whole = PETSc.Scatter.toAll(vector)
    scatter.scatter(vector, whole, PETSc.InsertMode.INSERT_VALUES, PETSc.ScatterMode.FORWARD)
    return np.array(whole.getArray())
