"""Problems from tables: terminal states need no masking."""

import numpy as np
import pytest

import serd_core as sc
from serd_core.dynamics.transition_model import transitions_at


def test_the_feature_of_a_terminal_state_counts_once():
    """One step to the end: Q = 0 + 0.5 * w for the step that arrives, whatever follows."""
    table = np.zeros((2, 1, 2))
    table[:, 0, 1] = 1.0
    for learned in (False, True):
        problem = sc.from_transitions(
            table, [[0.0], [1.0]], discount=0.5, terminal=[1], learned=learned
        )
        dynamics = np.ones(2) if learned else None
        np.testing.assert_allclose(sc.soft_policy(problem, [3.0], dynamics).value, [1.5, 3.0])
        assert problem.mdp.final.tolist() == [False, True]
        assert problem.mdp.transitions.n_parameters == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"transitions": np.ones((2, 1, 3))}, r"must have shape \(states, actions, states\)"),
        ({"transitions": {"state": [0]}}, "transitions must be an array of numbers"),
        ({"transitions": np.full((2, 1, 2), 0.4)}, "but the row sums to 0.8; normalise that row"),
        ({"features": np.ones(3)}, r"features must have shape \(2, F\) or \(2, 1, F\), got \(3,\)"),
        ({"features": np.zeros((2, 0))}, "at least one feature, got none"),
        ({"terminal": [2]}, r"terminal\[0\] must be a state from 0 to 1, got 2"),
    ],
)
def test_wrong_tables_are_rejected_with_a_sentence(change, message):
    given = {"transitions": np.full((2, 1, 2), 0.5), "features": np.ones((2, 1)), "discount": 0.9}
    with pytest.raises(sc.SerdError, match=message):
        sc.from_transitions(**given | change)


PLACES = [0, 1], [0, 0], [0, 0]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (((2, 1), *PLACES, [1, 0.5]), "state 1, action 0 .* sums to 0.5"),
        (((2, 1), *PLACES, [1.0]), r"probability must have shape \(2\)"),
        (((0, 1), [], [], [], []), "n_pairs must be at least one state"),
        (((2, 1), [0], [0], [2], [1]), r"next_state\[0\] must be a next"),
        ((2, *PLACES, np.ones(2)), r"n_pairs must have shape \(2\), got"),
        (((2.5, 1), *PLACES, np.ones(2)), r"n_pairs\[0\] must be a whole"),
    ],
)
def test_wrong_entries_are_rejected_with_a_sentence(given, sentence):
    with pytest.raises(sc.SerdError, match=sentence):
        sc.fixed_transitions(*given)


def test_entries_in_any_order_give_the_same_matrix():
    model = sc.fixed_transitions((2, 2), [1, 0, 0], [0, 1, 1], [1, 1, 0], [1.0, 0.25, 0.75])
    dense = transitions_at(model, np.zeros(0)).matrix.toarray()
    np.testing.assert_allclose(dense, [[0, 0], [0.75, 0.25], [0, 1], [0, 0]])
    np.testing.assert_array_equal(model.available, [[False, True], [True, False]])
    np.testing.assert_array_equal(model.absorbing, [False, True])
