import numpy as np
import pytest

from serd_core.ascent.lbfgs import Lbfgs
from serd_core.demonstrations.decisions import Decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.errors import SerdError
from serd_core.learners.policy_matching import fit_policy_matching
from serd_core.mdp.mdp import Mdp
from serd_core.mdp.problem import TabularProblem


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


def test_features_of_unavailable_actions_may_be_anything_and_count_nowhere():
    mdp = Mdp(models([[True, True], [True, False]]), 0.9)
    features = np.array([[[1.0], [2.0]], [[3.0], [np.nan]]])
    problem = TabularProblem(mdp, features, ("one",))
    np.testing.assert_array_equal(problem.features[..., 0], [[1.0, 2.0], [3.0, 0.0]])
    zero = np.zeros(1, dtype=int)
    fit = fit_policy_matching(
        problem,
        Decisions(zero, zero, zero, zero + 1, zero),
        initial_weights=np.zeros(1),
        dynamics=np.ones((1, 1)),
        ascent=Lbfgs(max_steps=1),
    )
    assert np.isfinite(fit.gradient_norm)
    features[0, 1] = np.nan
    with pytest.raises(SerdError, match=r"features\[0, 1, 0\] must be finite, got nan"):
        TabularProblem(mdp, features, ("one",))
