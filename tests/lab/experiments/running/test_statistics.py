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
