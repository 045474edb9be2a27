import numpy as np
import pytest

from lab.experiments.minimum_example.explanations import MinimumExampleConfig, fit_sets


def test_serd_finds_both_explanations_on_either_side_of_the_diagonal_and_irl_one():
    rows = fit_sets(MinimumExampleConfig(n_sets=24, sizes=(12, 30)), 24, 0)
    serd, irl = ([r for r in rows if r["learner"] == name] for name in ("MDCE SERD", "MDCE IRL"))
    assert {row["mode"] for row in serd} == {"A", "B"}
    assert all((row["mode"] == "B") == (row["moves_on_a"] > row["moves_on_b"]) for row in serd)
    assert all(row["moves_on_b"] == pytest.approx(0.5) for row in irl)
    assert sum(row["mode"] == "B" for row in irl) > 0.8 * len(irl)
    for learned in (serd, irl):
        assert np.mean([row["moves_on_a"] for row in learned]) == pytest.approx(2 / 3, abs=0.08)
