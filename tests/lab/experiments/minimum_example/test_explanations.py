import numpy as np
import pytest

from lab.experiments.minimum_example.explanations import (
    MinimumExampleConfig,
    fit_sets,
)

CONFIG = MinimumExampleConfig(n_sets=24, sizes=(12, 30))


@pytest.fixture(scope="module")
def rows():
    return fit_sets(CONFIG, 24, 0)


def of(rows, learner):
    return [row for row in rows if row["learner"] == learner]


def test_serd_finds_both_explanations_and_irl_one(rows):
    assert {row["mode"] for row in of(rows, "MDCE SERD")} == {"A", "B"}
    irl = of(rows, "MDCE IRL")
    assert all(row["moves_on_b"] == pytest.approx(0.5) for row in irl)
    assert sum(row["mode"] == "B" for row in irl) > 0.8 * len(irl)


def test_the_modes_lie_on_either_side_of_the_diagonal(rows):
    for row in of(rows, "MDCE SERD"):
        assert (row["mode"] == "B") == (row["moves_on_a"] > row["moves_on_b"])


def test_what_was_seen_is_learned_by_both(rows):
    for learner in ("MDCE SERD", "MDCE IRL"):
        mean = np.mean([row["moves_on_a"] for row in of(rows, learner)])
        assert mean == pytest.approx(2 / 3, abs=0.08)
