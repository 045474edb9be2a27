import numpy as np
import pytest

from lab.experiments.policy_cost import (
    by_adjoint,
    by_lu,
    cost_case,
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
