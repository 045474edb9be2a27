import numpy as np
import pytest

from serd_core.dynamics.sparse_model import SparseModel, fixed_transitions
from serd_core.dynamics.transitions import transitions_at
from serd_core.errors import SerdError


def test_entries_in_any_order_give_the_same_matrix():
    state, action, following = np.array([1, 0, 0]), np.array([0, 1, 1]), np.array([1, 1, 0])
    model = fixed_transitions((2, 2), state, action, following, np.array([1.0, 0.25, 0.75]))
    dense = transitions_at(model, np.zeros(0)).matrix.toarray()
    np.testing.assert_allclose(dense, [[0, 0], [0.75, 0.25], [0, 1], [0, 0]])
    np.testing.assert_array_equal(model.available, [[False, True], [True, False]])
    np.testing.assert_array_equal(model.absorbing, [False, True])


def test_a_non_stochastic_row_is_named():
    with pytest.raises(SerdError, match=r"state 1, action 0 .* sums to 0.5"):
        fixed_transitions((2, 1), [0, 1], [0, 0], [0, 0], np.array([1.0, 0.5]))


def test_a_successor_outside_is_named():
    with pytest.raises(SerdError, match=r"next_state\[1\] must be a next state from 0 to 1, got 2"):
        fixed_transitions((2, 1), [0, 1], [0, 0], [0, 2], np.ones(2))


def test_users_functions_of_the_wrong_length_are_refused():
    model = SparseModel(
        (1, 1), [0], [0], [0], 2, lambda _: np.ones(3), lambda _, gradient: gradient
    )
    with pytest.raises(SerdError, match=r"must return \(1,\) numbers, one per entry, got \(3,\)"):
        model.local_probabilities(np.zeros(2))
    with pytest.raises(SerdError, match=r"must return \(2,\) numbers, one per parameter"):
        model.pull_back(np.zeros(2), np.ones(1))
    with pytest.raises(SerdError, match=r"must be its \(2,\) parameters"):
        model.parameters_of(np.ones((1, 5)))


def test_probabilities_need_one_entry_per_transition():
    with pytest.raises(SerdError, match=r"probability must have shape \(2\), got \(1,\)"):
        fixed_transitions((2, 1), [0, 1], [0, 0], [0, 0], np.ones(1))
    with pytest.raises(SerdError, match=r"n_pairs must be at least one state .* got \(0, 1\)"):
        fixed_transitions((0, 1), [], [], [], np.ones(0))
    model = fixed_transitions((2, 1), [0, 1], [0, 0], [0, 0], np.ones(2))
    with pytest.raises(SerdError, match=r"probabilities must have shape \(2,\), .* got \(3,\)"):
        model.entries(np.ones(3))
