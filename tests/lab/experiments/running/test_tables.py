"""Tables as CSV, and medians and quartiles, also where a choice was ruled out."""

import numpy as np
import pandas as pd
import pytest

from lab.experiments.running.tables import quantile, write_table


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


def test_a_table_read_back_has_the_same_bits_and_is_written_alike(tmp_path):
    awkward = [0.1 + 0.2, 1e-300, -np.inf, np.nan, 5e-324, 1.7976931348623157e308, -0.0]
    table = pd.DataFrame({"value": awkward, "text": list("abcdefg"), "whole": range(7)})
    write_table(tmp_path / "first.csv", table)
    found = pd.read_csv(tmp_path / "first.csv", float_precision="round_trip")
    assert list(map(repr, found["value"].tolist())) == list(map(repr, awkward))
    write_table(tmp_path / "second.csv", found)
    assert (tmp_path / "second.csv").read_bytes() == (tmp_path / "first.csv").read_bytes()
