"""Quantiles, tables as CSV, intervals, and tests of differences within repetitions."""

import numpy as np
import pandas as pd
import pytest

from lab.experiments.running.statistics import (
    StatisticsSettings,
    holm,
    mean_interval,
    paired_family,
    paired_p_value,
)
from lab.experiments.running.tables import quantile, quartiles, welch_test, write_table

SETTINGS = StatisticsSettings(bootstrap=2000, coverage=0.95)


def test_holm_multiplies_the_smallest_by_all_the_next_by_one_less():
    # R: p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_differences_of_one_sign_have_the_exact_p_value_of_all_sign_flips():
    first, second = [2.0, 3.0, 4.0, 5.0], [1.0, 1.0, 1.0, 1.0]
    assert paired_p_value(first, second, np.random.default_rng(0)) == pytest.approx(2 / 2**4)


def test_an_interval_holds_the_mean_and_narrows_with_more_repetitions():
    rng = np.random.default_rng(3)
    few, many = rng.normal(size=8), rng.normal(size=200)
    narrow = mean_interval(many.tolist(), SETTINGS, rng)
    wide = mean_interval(few.tolist(), SETTINGS, rng)
    assert narrow.value == pytest.approx(many.mean())
    assert narrow.lower < narrow.value < narrow.upper
    assert narrow.upper - narrow.lower < wide.upper - wide.lower
    # The normal interval of 200 values with known deviation.
    assert narrow.upper - narrow.lower == pytest.approx(2 * 1.96 / np.sqrt(200), rel=0.15)


def test_a_family_is_first_minus_each_other_with_holm_over_all():
    first = np.arange(3.0, 8.0)
    values = pd.DataFrame({"one less": first - 1.0, "ours": first, "two more": first + 2.0})
    rows = paired_family(values, "ours", SETTINGS, np.random.default_rng(0))
    assert [(row["second"], row["mean_difference"]) for row in rows] == [
        ("one less", 1.0),
        ("two more", -2.0),
    ]
    assert [row["lower"] for row in rows] == [1.0, -2.0]
    assert [row["p_value"] for row in rows] == pytest.approx([2 / 2**5] * 2)
    assert [row["p_holm"] for row in rows] == pytest.approx([4 / 2**5] * 2)


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


def test_a_table_has_the_shortest_exact_texts_and_nothing_for_undefined_cells(tmp_path):
    awkward = [0.1 + 0.2, 1e-300, -np.inf, np.nan, 5e-324, 1.7976931348623157e308, -0.0]
    write_table(tmp_path / "a.csv", pd.DataFrame({"value": awkward, "whole": range(7)}))
    texts = [line.split(",")[0] for line in (tmp_path / "a.csv").read_text().splitlines()[1:]]
    assert texts == ["" if np.isnan(value) else repr(value) for value in awkward]


def test_quartiles_are_numpys_and_welch_needs_two_values_of_each():
    values = [1.0, 2.0, 4.0, 8.0]
    rows = [{"size": 3, "learner": "ours", "x": each} for each in values]
    table = pd.DataFrame([*rows, {"size": 3, "learner": "theirs", "x": 0.0}])
    (ours, _) = quartiles(table, "x", ["size", "learner"]).to_dict("records")
    assert [ours[name] for name in ("n", "lower", "median", "upper")] == [4, 1.75, 3.0, 5.0]
    (alone,) = welch_test(table, "x", "ours", "theirs")
    assert alone["p_value"] is None
    (same,) = welch_test(table, "x", "ours", "ours")
    assert (same["mean_difference"], same["p_value"]) == (0.0, 1.0)
