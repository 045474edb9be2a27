"""Directions without a maximum, of objectives for which they are known."""

import numpy as np
import pytest

from serd_core.ascent.ascent import FunctionObjective, Lbfgs
from serd_core.learners.certificate import judged_weights, open_directions

NAMES = ("first", "second", "third")
ROWS = np.random.default_rng(0).normal(size=(40, 2))
SEPARABLE = ROWS @ [1.0, -2.0] > 0
NOISY = ROWS @ [1.0, -2.0] + np.random.default_rng(1).logistic(size=40) > 0


def logistic(rows, labels, precision=0.0):
    """Mean log-likelihood of a logistic model with a normal prior, and where its ascent ends."""
    signed = np.where(np.array(labels)[:, None], 1.0, -1.0) * np.array(rows, dtype=float)

    def evaluate(w):
        margin = signed @ w
        value = -np.mean(np.logaddexp(0.0, -margin)) - 0.5 * precision * w @ w
        return value, signed.T @ (1 / (1 + np.exp(margin))) / len(signed) - precision * w

    objective = FunctionObjective(evaluate)
    return objective, Lbfgs().maximise(objective, np.zeros(signed.shape[1]))


@pytest.mark.parametrize(
    ("labels", "precision"), [(NOISY, 0.0), (SEPARABLE, 1.0), (SEPARABLE, 1e-6)]
)
def test_a_maximum_has_no_open_direction_and_a_prior_bounds_separable_data(labels, precision):
    objective, end = logistic(ROWS, labels, precision)
    found = open_directions(objective, end.vector)
    assert len(found.growing) == len(found.flat) == 0


@pytest.mark.parametrize("weights", [(0.0, 0.0), (2.0, -1.0)])
def test_what_nothing_depends_on_is_flat(weights):
    """A number that is in no row, and two that are in all rows as their sum."""
    objective, end = logistic(np.column_stack([ROWS, ROWS @ weights]), NOISY)
    found = open_directions(objective, end.vector)
    assert len(found.growing) == 0
    (way,) = found.flat
    known = np.array([*weights, -1.0]) / np.linalg.norm([*weights, -1.0])
    assert abs(way @ known) == pytest.approx(1.0, abs=1e-6)
    judged, undetermined = judged_weights(objective, end, np.ones(3), NAMES, "leave it out")
    assert judged.message == f"not converged: nothing determines {undetermined[0]}; leave it out"
    assert "third" in undetermined[0]


def test_one_number_that_runs_away_is_found_among_others_that_do_not():
    """The third is 1 where the label is true only."""
    rows = np.column_stack([ROWS, NOISY & (np.arange(40) % 3 == 0)])
    objective, end = logistic(rows, NOISY)
    found = open_directions(objective, end.vector)
    np.testing.assert_allclose(found.growing[0], [0.0, 0.0, 1.0], atol=0.02)


def test_kinks_and_other_maxima_are_no_open_directions():
    kink = FunctionObjective(lambda x: (-float(np.abs(x).sum()), -np.sign(x)))
    assert len(open_directions(kink, np.zeros(2), kinked=True).growing) == 0

    def higher_farther_on(x):
        value = float(-np.sum((x**2 - 25.0) ** 2) / 100 + 0.1 * x.sum())
        return value, -4 * x * (x**2 - 25.0) / 100 + 0.1

    two = FunctionObjective(higher_farther_on)
    end = Lbfgs().maximise(two, np.full(1, -6.0))
    assert end.converged
    found = open_directions(two, end.vector)
    assert len(found.growing) == len(found.flat) == 0


def test_an_ascent_that_was_stopped_or_is_far_from_its_end_stays_as_it_is():
    objective, _ = logistic(ROWS, SEPARABLE)
    stopped = Lbfgs().maximise(objective, np.zeros(2), lambda step: step.number == 2)
    short = Lbfgs(max_steps=1).maximise(objective, np.zeros(2))
    for end in (stopped, short):
        assert judged_weights(objective, end, np.ones(2), NAMES[:2], "stop") == (end, ())
