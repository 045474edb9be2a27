"""QuantEcon: a sparse DiscreteDP from a file, by policy iteration and by value iteration.

    python quantecon_solve.py problem.npz result.npz

Run in the environment of learning.txt. Timed is `solve`, the best of several after a first call
that compiles, in processor time.
"""

import sys
import time
from pathlib import Path

import numpy as np
import quantecon
import scipy.sparse

AT_LEAST_S = 1.0


def main(problem_file: Path, result_file: Path) -> None:
    """Solve, write values and seconds by method."""
    given = np.load(problem_file)
    shape = tuple(given["shape"])
    matrix = scipy.sparse.csr_matrix((given["data"], given["indices"], given["indptr"]), shape)
    problem = quantecon.markov.DiscreteDP(
        given["rewards"], matrix, float(given["discount"]), given["state"], given["action"]
    )
    found = {}
    for method, settings in (
        ("policy_iteration", {}),
        ("modified_policy_iteration", {"epsilon": float(given["epsilon"])}),
        ("value_iteration", {"epsilon": float(given["epsilon"])}),
    ):
        seconds, began_s = [], time.process_time()
        problem.solve(method=method, max_iter=1_000_000, **settings)
        while len(seconds) < 1 or time.process_time() - began_s < AT_LEAST_S:
            start_s = time.process_time()
            solution = problem.solve(method=method, max_iter=1_000_000, **settings)
            seconds.append(time.process_time() - start_s)
        found[f"{method}_value"], found[f"{method}_seconds"] = solution.v, min(seconds)
    np.savez(result_file, **found)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
