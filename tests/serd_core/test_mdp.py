import numpy as np
import pytest

from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.mdp import Mdp


def models(available):
    return OutcomeModels(np.zeros((2, 2, 1), int), np.zeros((2, 2), int), np.array(available), 1)


def test_a_state_without_actions_is_named():
    with pytest.raises(SerdError, match="state 1 must have at least one available action"):
        Mdp(models([[True, True], [False, False]]), 0.9)


@pytest.mark.parametrize("discount", [-0.1, 1.0, float("nan"), float("inf")])
def test_a_discount_outside_zero_to_one_is_refused(discount):
    with pytest.raises(SerdError, match=r"discount must be in \[0, 1\), got"):
        Mdp(models([[True, True], [True, True]]), discount)


def test_states_that_nothing_leaves_are_absorbing():
    mdp = Mdp(models([[True, True], [True, False]]), 0.9)
    np.testing.assert_array_equal(mdp.absorbing, [True, False])
