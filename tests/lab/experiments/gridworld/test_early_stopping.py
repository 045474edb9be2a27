"""Early stopping against fits to the maximum, and the optimisers they may use."""

import numpy as np
import pytest
from pydantic import ValidationError

from lab.experiments.gridworld.ascents import LOOKS, AscentsConfig, climb
from lab.experiments.gridworld.early_stopping import (
    PART,
    STOPPED,
    WHOLE,
    EarlyStoppingConfig,
    one_repetition,
)

SMALL = EarlyStoppingConfig(max_steps=20, side=5, sizes=(2,), n_steps=8, n_repetitions=1)


@pytest.mark.parametrize("ascent", ["trust-region", "gradient"])
def test_a_stopped_fit_takes_no_more_steps_than_the_fit_to_its_maximum(ascent):
    config = EarlyStoppingConfig(
        ascent=ascent, max_steps=40, side=5, sizes=(2,), n_steps=8, n_repetitions=1
    )
    rows = {row["learner"]: row for row in one_repetition(config, 0)}
    assert set(rows) == {WHOLE, PART, STOPPED}
    assert rows[STOPPED]["steps"] <= rows[PART]["steps"]


def test_repetitions_are_reproducible():
    assert one_repetition(SMALL, 0) == one_repetition(SMALL, 0)


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


def test_a_trace_has_the_objective_after_each_step():
    row, trace = climb(AscentsConfig(side=4, n_demonstrations=5, n_steps=8), "trust-region")
    assert list(trace.index) == list(range(1, row["n_steps"] + 1))
    assert np.all(np.diff(trace["objective"]) >= -1e-9)


def test_wrong_settings_are_refused_by_name():
    with pytest.raises(ValidationError, match="'gradient', 'lbfgs' or 'trust-region'"):
        EarlyStoppingConfig(ascent="newton")
    with pytest.raises(ValidationError, match=r"sizes.0\n.* greater than or equal to 2"):
        EarlyStoppingConfig(sizes=(1,))
    with pytest.raises(ValidationError, match=r"step_size\n.* greater than 0"):
        AscentsConfig(step_size=0.0)
