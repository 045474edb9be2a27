"""irl-maxent: maximum causal entropy IRL on route choices from a file.

    python irl_maxent_fit.py LEARNING_RATE problem.npz result.json

Run in the environment of irl_maxent.txt, with a tolerance of the weights of 1e-6, as its default of
1e-4 stops far from the optimum. Timed is `irl_causal`, in processor time. It returns rewards of
states, from which the weights follow.
"""

import json
import sys
import time
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
from irl_maxent.maxent import irl_causal
from irl_maxent.optimizer import Sga
from irl_maxent.trajectory import Trajectory


def main(learning_rate: float, problem_file: Path, result_file: Path) -> None:
    """Fit, write weights and seconds."""
    warnings.simplefilter("ignore", DeprecationWarning)  # of np.float
    given = np.load(problem_file)
    routes = np.split(given["links"], np.cumsum(given["lengths"])[:-1])
    episodes = [Trajectory([(a, 0, b) for a, b in pairwise(route)]) for route in routes]
    began_s = time.process_time()
    rewards = irl_causal(
        given["transitions"],
        given["features"],
        [int(given["goal"])],
        episodes,
        Sga(learning_rate),
        lambda _: given["initial_weights"].copy(),
        discount=1.0,
        eps=1e-6,
    )
    seconds = time.process_time() - began_s
    weights = np.linalg.lstsq(given["features"], rewards, rcond=None)[0].tolist()
    result_file.write_text(json.dumps({"weights": weights, "seconds": seconds, "converged": True}))


if __name__ == "__main__":
    main(float(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]))
