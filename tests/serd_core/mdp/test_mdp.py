import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import serd_core as sc
from serd_core.dynamics.transition_model import transitions_at, transitions_of
from serd_core.learners.mdce_irl import state_action_occupancy
from serd_core.mdp.mdp import checked_distribution
from support.refusals import refusals

ALL = [[True, True], [True, True]]


def mdp_of(available, discount=0.9):
    tables = np.zeros((2, 2, 1), int), np.zeros((2, 2), int), np.array(available)
    return sc.Mdp(sc.OutcomeModels(*tables, 1), discount)


def uniform(mdp):
    return mdp.available / mdp.available.sum(axis=1, keepdims=True)


def test_states_that_nothing_leaves_are_absorbing():
    np.testing.assert_array_equal(mdp_of([[True, True], [True, False]]).absorbing, [True, False])


def test_features_of_unavailable_actions_may_be_anything_and_count_nowhere():
    mdp = mdp_of([[True, True], [True, False]])
    features = np.array([[[1.0], [2.0]], [[3.0], [np.nan]]])
    problem = sc.TabularProblem(mdp, features, ("one",))
    np.testing.assert_array_equal(problem.features[..., 0], [[1.0, 2.0], [3.0, 0.0]])
    features[0, 1] = np.nan
    with pytest.raises(sc.SerdError, match=r"features\[0, 1, 0\] must be finite, got nan"):
        sc.TabularProblem(mdp, features, ("one",))


def test_a_distribution_may_be_as_rounded_as_tables_of_files_are():
    third = np.array([0.3333333, 0.3333333, 0.3333334])
    np.testing.assert_array_equal(checked_distribution("starts", third, 3), third)


def distribution(values):
    return checked_distribution("starts", np.array(values), 2)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), discount=st.sampled_from([0.0, 0.5, 0.8, 0.99]))
def test_visits_are_the_sum_of_the_distributions_over_time(random_problem, seed, discount):
    """Naive twin: push the distribution through the chain, step by step."""
    problem, table = random_problem(seed, discount)
    mdp = problem.mdp
    policy, starts = uniform(mdp), np.random.default_rng(seed).dirichlet(np.ones(mdp.n_states))
    transitions = transitions_of(mdp.transitions, table)
    visits = state_action_occupancy(mdp, transitions, policy, starts)
    assert visits.sum() == pytest.approx(1 / (1 - discount))
    assert np.all(visits[~mdp.available] == 0)
    dense = transitions.matrix.toarray().reshape(*policy.shape, -1)
    chain = np.einsum("sa,sat->st", policy, dense)
    summed, present = np.zeros(mdp.n_states), starts
    for step in range(3000 if discount > 0.9 else 200):
        summed += discount**step * present
        present = present @ chain
    np.testing.assert_allclose(visits.sum(axis=1), summed, atol=1e-9)


def test_the_feature_of_a_terminal_state_counts_once():
    """One step to the end: Q = 0 + 0.5 * w for the step that arrives, whatever follows."""
    table = np.zeros((2, 1, 2))
    table[:, 0, 1] = 1.0
    problem = sc.from_transitions(table, [[0.0], [1.0]], discount=0.5, terminal=[1])
    np.testing.assert_allclose(sc.soft_policy(problem, [3.0]).value, [1.5, 3.0])
    assert problem.mdp.final.tolist() == [False, True]
    assert problem.mdp.transitions.n_parameters == 0


def from_tables(**change):
    given = {"transitions": np.full((2, 1, 2), 0.5), "features": np.ones((2, 1)), "discount": 0.9}
    return lambda: sc.from_transitions(**given | change)


def entries(*given):
    return lambda: sc.fixed_transitions(*given)


PLACES = [0, 1], [0, 0], [0, 0]
test_wrong_tables_and_distributions_are_rejected_with_the_place = refusals(
    (lambda: mdp_of([[True, True], [False, False]]), "state 1 must have at least one avail"),
    *[(lambda g=g: mdp_of(ALL, g), r"in \[0, 1\), got") for g in (-0.1, 1.0, np.nan, np.inf)],
    (lambda: distribution([0.5, 0.6]), "starts must sum to 1, got a sum of 1.1; normalise it"),
    (lambda: distribution([1.5, -0.5]), r"starts\[1\] must not be negative, got -0.5"),
    (from_tables(transitions=np.ones((2, 1, 3))), r"have shape \(states, actions, states\)"),
    (from_tables(transitions={"state": [0]}), "transitions must be an array of numbers"),
    (from_tables(transitions=np.full((2, 1, 2), 0.4)), "row sums to 0.8; normalise that row"),
    (from_tables(features=np.ones(3)), r"must have shape \(2, F\) or \(2, 1, F\), got \(3,\)"),
    (from_tables(features=np.zeros((2, 0))), "at least one feature, got none"),
    (from_tables(terminal=[2]), r"terminal\[0\] must be a state from 0 to 1, got 2"),
    (entries((2, 1), *PLACES, [1, 0.5]), "state 1, action 0 .* sums to 0.5"),
    (entries((2, 1), *PLACES, [1.0]), r"probability must have shape \(2\)"),
    (entries((0, 1), [], [], [], []), "n_pairs must be at least one state"),
    (entries((2, 1), [0], [0], [2], [1]), r"next_state\[0\] must be a next"),
    (entries(2, *PLACES, np.ones(2)), r"n_pairs must have shape \(2\), got"),
    (entries((2.5, 1), *PLACES, np.ones(2)), r"n_pairs\[0\] must be a whole"),
)


def test_entries_in_any_order_give_the_same_matrix():
    model = sc.fixed_transitions((2, 2), [1, 0, 0], [0, 1, 1], [1, 1, 0], [1.0, 0.25, 0.75])
    dense = transitions_at(model, np.zeros(0)).matrix.toarray()
    np.testing.assert_allclose(dense, [[0, 0], [0.75, 0.25], [0, 1], [0, 0]])
    np.testing.assert_array_equal(model.available, [[False, True], [True, False]])
    np.testing.assert_array_equal(model.absorbing, [False, True])
