import numpy as np
import pytest

from lab.experiments.running.divergence import dynamics_divergence
from support.small_problems import minimum_example_problem

#: Of two pairs that are visited alike one differs.
HALF = 0.5 * (0.9 * np.log(0.9 / 0.2) + 0.1 * np.log(0.1 / 0.8))


@pytest.mark.parametrize(
    ("visits", "one", "two", "divergence"),
    [
        # In state 2 both outcomes stay: how they share does not matter there.
        ([[0, 0, 0], [0, 0, 1]], [[0.9, 0.1], [0.5, 0.5]], [[0.2, 0.8], [0.5, 0.5]], 0.0),
        ([[1, 0, 0], [0, 0, 1]], [[0.9, 0.1], [0.5, 0.5]], [[0.2, 0.8], [0.5, 0.5]], HALF),
        # What is true is ruled out, which does not matter in pairs that are never visited.
        ([[1, 0, 0], [0, 0, 0]], [[1.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]], np.inf),
        ([[0, 1, 0], [0, 0, 0]], [[1.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]], 0.0),
    ],
)
def test_divergence_compares_transitions_that_are_visited(visits, one, two, divergence):
    found = dynamics_divergence(
        minimum_example_problem(0.9), np.array(one), np.array(two), np.array(visits, float)
    )
    assert found == pytest.approx(divergence)
