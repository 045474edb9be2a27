"""Solves over MPI: `apt install python3-petsc4py`, with a NumPy below 2 beside it."""

import importlib.util
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

if importlib.util.find_spec("petsc4py") is None:
    pytest.skip("petsc4py is not installed", allow_module_level=True)

from serd_core.bellman.backup import BellmanProblem
from serd_core.bellman.equations import SoftBellman
from serd_core.bellman.linear.lu import SparseLu
from serd_core.bellman.linear.petsc import Petsc
from serd_core.bellman.newton import Newton
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.mdp.mdp import Mdp

N_STATES = 500


def values_and_gradient(solver):
    """Values of a ring, their error bound, and the gradient of weighted values by rewards."""
    successors = (np.arange(N_STATES)[:, None] + np.array([0, 1, -1, 7])) % N_STATES
    models = OutcomeModels(
        np.repeat(successors[:, None], 4, axis=1),
        np.tile(np.arange(4), (N_STATES, 1)),
        np.ones((N_STATES, 4), dtype=bool),
        4,
    )
    mdp, rng = Mdp(models, 0.99), np.random.default_rng(1)
    transitions = transitions_of(models, 0.05 + 0.8 * np.eye(4))
    problem = BellmanProblem(SoftBellman(), rng.normal(size=(N_STATES, 4)), transitions, mdp)
    solution = Newton(linear_solver=solver).solve(problem)
    assert solution.converged
    data = transitions.system_data(mdp.policy_pattern, solution.policy, mdp.discount)
    system = solver.prepare(mdp.policy_pattern, data)
    both = rng.normal(size=(N_STATES, 2))
    return solution.value, system.solve(both, transposed=True), solution.error_bound


def test_one_process_has_the_values_and_gradients_of_lu():
    (value, gradient, bound), (expected, slope, other) = (
        values_and_gradient(solver) for solver in (Petsc(), SparseLu())
    )
    assert np.max(np.abs(value - expected)) <= bound + other
    np.testing.assert_allclose(gradient, slope, rtol=0, atol=1e-9 * np.max(np.abs(slope)))


def test_two_processes_have_the_results_of_one(tmp_path):
    mpiexec = shutil.which("mpiexec") or pytest.skip("mpiexec is not on the path")
    command = [mpiexec, "-n", "2", sys.executable, __file__, str(tmp_path)]
    # The environment before MPI began here, whose variables would refuse another run.
    subprocess.run(command, check=True, timeout=300, env=dict(os.environ))
    value, gradient, bound = values_and_gradient(Petsc())
    for rank in range(2):
        there = np.load(tmp_path / f"{rank}.npz")
        assert there["size"] == 2
        assert np.max(np.abs(there["value"] - value)) <= 2 * bound
        np.testing.assert_allclose(
            there["gradient"], gradient, rtol=0, atol=1e-9 * np.max(np.abs(gradient))
        )


def test_a_system_that_is_not_solved_is_refused():
    with pytest.raises(SerdError, match=r"Petsc must reach .* raise max_iterations"):
        values_and_gradient(Petsc(max_iterations=1))


def write_results(folder):
    """Write the results of this process into a file of its rank."""
    from petsc4py import PETSc

    value, gradient, _ = values_and_gradient(Petsc())
    world = PETSc.COMM_WORLD
    np.savez(f"{folder}/{world.rank}.npz", value=value, gradient=gradient, size=world.size)


if __name__ == "__main__":
    write_results(sys.argv[1])
