"""Early stopping against fits to the maximum, and the optimisers they may use."""

import pytest

from lab.experiments.gridworld.ascents import LOOKS, AscentsConfig, climb
from lab.experiments.gridworld.early_stopping import (
    PART,
    STOPPED,
    WHOLE,
    EarlyStoppingConfig,
    one_repetition,
)


def test_a_stopped_fit_takes_no_more_steps_than_the_fit_to_its_maximum():
    config = EarlyStoppingConfig(
        ascent="gradient", max_steps=40, side=5, sizes=(2,), n_steps=8, n_repetitions=1
    )
    rows = {row["learner"]: row for row in one_repetition(config, 0)}
    assert set(rows) == {WHOLE, PART, STOPPED}
    assert rows[STOPPED]["steps"] <= rows[PART]["steps"]


def test_gradient_ascent_is_still_below_the_maximum_that_the_others_have_reached():
    config = AscentsConfig(
        side=4, n_demonstrations=30, n_steps=10, gradient_tolerance=1e-3, max_steps=100
    )
    rows = {name: climb(config, name)[0] for name in LOOKS}
    assert rows["lbfgs"]["converged"]
    assert rows["trust-region"]["converged"]
    assert rows["lbfgs"]["objective"] == pytest.approx(rows["trust-region"]["objective"], abs=0.5)
    assert not rows["gradient"]["converged"]
    assert rows["gradient"]["n_steps"] == 100
    assert rows["gradient"]["objective"] < rows["trust-region"]["objective"] - 1.0
