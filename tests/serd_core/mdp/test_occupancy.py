import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.dynamics.transition_model import transitions_of
from serd_core.learners.mdce_irl import state_action_occupancy


def uniform(mdp):
    return mdp.available / mdp.available.sum(axis=1, keepdims=True)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10_000), discount=st.sampled_from([0.0, 0.5, 0.99]))
def test_visits_sum_to_the_geometric_series(random_problem, seed, discount):
    problem, table = random_problem(seed, discount)
    mdp = problem.mdp
    starts = np.random.default_rng(seed).dirichlet(np.ones(mdp.n_states))
    transitions = transitions_of(mdp.transitions, table)
    visits = state_action_occupancy(mdp, transitions, uniform(mdp), starts)
    assert visits.sum() == pytest.approx(1 / (1 - discount))
    assert np.all(visits >= -1e-12)
    assert np.all(visits[~mdp.available] == 0)


def test_visits_are_the_sum_of_the_distributions_over_time(random_problem):
    """Naive twin: push the distribution through the chain, step by step."""
    problem, table = random_problem(8, 0.8)
    mdp = problem.mdp
    policy, present = uniform(mdp), np.eye(mdp.n_states)[0]
    dense = mdp.transitions.matrix(mdp.transitions.entries(table)).toarray()
    chain = np.einsum("sa,sat->st", policy, dense.reshape(*policy.shape, -1))
    summed = np.zeros(mdp.n_states)
    for step in range(300):
        summed += 0.8**step * present
        present = present @ chain
    found = state_action_occupancy(
        mdp, transitions_of(mdp.transitions, table), policy, np.eye(mdp.n_states)[0]
    )
    np.testing.assert_allclose(found.sum(axis=1), summed, atol=1e-10)
