"""Medians and quartiles, also where a choice was ruled out."""

import numpy as np
import pytest

from experiments.running.summary import quantile, quartiles


@pytest.mark.parametrize("n_values", [1, 2, 5, 12, 50])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_quantile_of_finite_values_is_numpys(n_values, share):
    values = np.random.default_rng(n_values).normal(size=n_values)
    assert quantile(values, share) == pytest.approx(np.quantile(values, share))


def test_infinite_values_have_their_place():
    assert quantile([-np.inf, -1.0, -2.0, -3.0], 0.5) == -2.5
    assert quantile([-np.inf, -1.0, -2.0, -3.0], 0.25) == -np.inf
    assert quantile([-np.inf, -np.inf, -1.0], 0.25) == -np.inf
    assert quantile([-np.inf, -np.inf, -1.0], 1.0) == -1.0


def test_quartiles_are_taken_apart_for_every_combination():
    rows = [{"size": 1 + number % 2, "score": float(number)} for number in range(6)]
    assert quartiles(rows, "score", ["size"]) == [
        {"size": 1, "n": 3.0, "lower": 1.0, "median": 2.0, "upper": 3.0},
        {"size": 2, "n": 3.0, "lower": 2.0, "median": 3.0, "upper": 4.0},
    ]
