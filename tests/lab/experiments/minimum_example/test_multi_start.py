"""Distinct explanations of one behaviour, counted over random starts."""

import pandas as pd

from lab.experiments.minimum_example.multi_start import (
    MultiStartConfig,
    explain_set,
    explanation_shares,
    fits_of_set,
)

CONFIG = MultiStartConfig(n_sets=2, sizes=(12,), n_starts=8)


def test_the_minimum_example_has_two_explanations():
    found = fits_of_set(CONFIG, 0)
    assert len(found.explanations) == 2
    signs = {float(each.fit.reward_weights[0]) > 0 for each in found.explanations}
    assert signs == {True, False}
    (row,) = explain_set(CONFIG, 0)
    assert row["n_converged"] == 8
    assert row["objective"] >= row["next_objective"]


def test_shares_of_each_size_sum_to_one():
    table = pd.DataFrame({"size": [1, 1, 3, 3], "n_explanations": [0, 1, 2, 5]})
    shares = explanation_shares(table)
    assert shares.to_dict("records") == [
        {"size": 1, "none": 0.5, "1": 0.5, "2": 0.0, "3 or more": 0.0},
        {"size": 3, "none": 0.0, "1": 0.0, "2": 0.5, "3 or more": 0.5},
    ]
