"""Rust (1987), Econometrica 55(5), Table IX: published estimates on the original data.

The data are not part of the project; see `../shared/data/rust1987` beside a checkout.
"""

from pathlib import Path

import pytest

from lab.experiments.rust import RustConfig, estimate_rust

DATA = Path(__file__).parents[3] / "shared" / "data" / "rust1987"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason=f"Rust's bus data are not there; put the original files in {DATA}"
)


def test_the_group_4_row_is_reproduced_to_the_printed_digits():
    result = estimate_rust(RustConfig(data=DATA, groups=(4,), n_bins=90, discount=0.9999))
    assert result.fit.converged
    assert (result.n_decisions, result.n_replacements) == (4292, 33)
    assert f"{result.replacement_cost:.4f}" == "10.0750"
    assert f"{result.replacement_cost_error:.3f}" == "1.582"
    assert f"{result.maintenance_cost:.4f}" == "2.2930"
    assert f"{result.maintenance_cost_error:.3f}" == "0.639"
    assert f"{result.increments[0]:.4f}" == "0.3919"
    assert f"{result.increments[1]:.4f}" == "0.5953"
    assert f"{result.log_likelihood:.3f}" == "-3304.155"


def test_pooled_groups_are_reproduced_too():
    """Rows of groups 1, 2, 3 and of groups 1, 2, 3, 4."""
    three = estimate_rust(RustConfig(data=DATA, groups=(1, 2, 3)))
    four = estimate_rust(RustConfig(data=DATA, groups=(1, 2, 3, 4)))
    assert f"{three.replacement_cost:.4f}" == "11.7270"
    assert three.maintenance_cost == pytest.approx(4.8259, abs=2e-4)
    assert f"{three.log_likelihood:.3f}" == "-2708.366"
    assert f"{four.replacement_cost:.4f}" == "9.7558"
    assert four.maintenance_cost == pytest.approx(2.6275, abs=2e-4)
    assert f"{four.log_likelihood:.3f}" == "-6055.250"


def test_a_short_sighted_planner_explains_group_4_less_well():
    far = estimate_rust(RustConfig(data=DATA, discount=0.9999))
    near = estimate_rust(RustConfig(data=DATA, discount=0.0))
    assert near.fit.converged
    assert f"{near.replacement_cost:.4f}" == "7.6358"
    assert near.maintenance_cost == pytest.approx(71.5133, abs=2e-4)
    assert near.log_likelihood < far.log_likelihood - 1.0
