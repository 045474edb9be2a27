import numpy as np
import pytest

from lab.experiments.policy_cost import (
    METHODS,
    STATED,
    PolicyCostConfig,
    by_adjoint,
    by_lu,
    cost_case,
    fitted_exponents,
    measure_policy_cost,
    soft_step,
)


@pytest.fixture
def case():
    return cost_case(9, 2, 3, np.random.default_rng(0))


def test_repeated_soft_steps_approach_the_gradient_by_lu(case):
    exact = by_lu(case)
    after = case.immediate + 0.9 * case.chain @ exact
    np.testing.assert_allclose(after, exact, atol=1e-10)
    np.testing.assert_allclose(soft_step(case), case.immediate + 0.9 * case.chain @ case.immediate)


def test_the_adjoint_gives_the_same_gradient_of_an_objective(case):
    np.testing.assert_allclose(by_adjoint(case), case.immediate[:, 0] @ by_lu(case), atol=1e-10)


def test_exponents_are_fitted_from_the_seconds_of_each_ladder():
    ticks = iter(range(1_000_000))
    config = PolicyCostConfig(
        base=(9, 2, 2), n_states=(9, 16), n_actions=(2, 3), n_parameters=(2, 3), repeats=1
    )
    rows = measure_policy_cost(config, lambda: float(next(ticks)))
    assert len(rows) == 6 * len(METHODS)
    table = fitted_exponents(rows)
    assert len(table) == sum(len(stated) for stated in STATED.values())
    assert list(table["fitted"]) == pytest.approx([0.0] * len(table))
