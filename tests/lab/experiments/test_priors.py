import numpy as np
import pytest

from lab.experiments.priors import PRIORS, PriorsConfig, optimal_distributions
from lab.experiments.running.tables import plain_rows


def test_each_prior_prefers_the_points_of_the_circle_that_table_4_3_has():
    rows = plain_rows(optimal_distributions(PriorsConfig(n_angles=720)))
    optima = {name: [row for row in rows if row["prior"] == name] for name in PRIORS}
    # Four optima of the L1 norm, two of which give the same distribution; none of the L2 norm.
    found = sorted(row["p_1"] for row in optima["L1"])
    corner = 1 / (1 + np.exp(-1.0))
    np.testing.assert_allclose(found, [1 - corner, 1 - corner, corner, corner], atol=1e-4)
    assert [row["p_1"] for row in optima["L2"]] == [None]
    # Entropy is highest on the line of equal parameters.
    assert len(optima["Entropy"]) == 2
    for row in optima["Entropy"]:
        assert row["theta_1"] == pytest.approx(row["theta_2"], abs=1e-3)
        assert row["p_1"] == pytest.approx(0.5, abs=1e-3)
    # The divergence comes as close to its reference, 0.9, as the circle allows.
    (row,) = optima["KLD(Q||P)"]
    closest = 1 / (1 + np.exp(-np.sqrt(2)))
    assert row["p_1"] == pytest.approx(closest, abs=1e-6)
    assert closest < 0.9
