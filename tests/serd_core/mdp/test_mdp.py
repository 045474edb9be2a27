import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serd_core.ascent.ascent import Lbfgs
from serd_core.demonstrations.decisions import Decisions
from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.outcome_models import OutcomeModels
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import state_action_occupancy
from serd_core.learners.policy_matching import fit_policy_matching
from serd_core.mdp.mdp import Mdp, checked_distribution, checked_policy
from serd_core.mdp.problem import TabularProblem
from serd_core.selection.evaluation import policy_log_likelihood

ALL = [[True, True], [True, True]]


def mdp_of(available, discount=0.9):
    tables = np.zeros((2, 2, 1), int), np.zeros((2, 2), int), np.array(available)
    return Mdp(OutcomeModels(*tables, 1), discount)


def uniform(mdp):
    return mdp.available / mdp.available.sum(axis=1, keepdims=True)


def test_states_that_nothing_leaves_are_absorbing():
    np.testing.assert_array_equal(mdp_of([[True, True], [True, False]]).absorbing, [True, False])


def test_features_of_unavailable_actions_may_be_anything_and_count_nowhere():
    mdp = mdp_of([[True, True], [True, False]])
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


THIRD = np.array([0.3333333, 0.3333333, 0.3333334])  # as tables of files are rounded


def distribution(values):
    return checked_distribution("starts", np.array(values), 2)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: mdp_of([[True, True], [False, False]]), "state 1 must have at least one avail"),
        *[(lambda g=g: mdp_of(ALL, g), r"in \[0, 1\), got") for g in (-0.1, 1.0, np.nan, np.inf)],
        (lambda: distribution([0.5, 0.6]), "starts must sum to 1, got a sum of 1.1; normalise it"),
        (lambda: distribution([1.5, -0.5]), r"starts\[1\] must not be negative, got -0.5"),
        (lambda: distribution([1.0, np.nan]), r"starts\[1\] must be finite, got nan"),
        (lambda: distribution([1.0]), r"starts must have shape \(2\), got \(1,\)"),
    ],
)
def test_what_is_no_process_and_no_distribution_is_refused_with_the_place(call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call()
    np.testing.assert_array_equal(checked_distribution("starts", THIRD, 3), THIRD)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        (0.7, r"policy\[3\] must sum to 1, got 1.4\d+; normalise over actions"),
        (-0.2, r"policy\[3, 1\] must be a probability of an available action, got -0.2"),
        (np.nan, r"policy\[3, 1\] must be finite, got nan"),
    ],
)
def test_every_use_of_a_policy_refuses_a_row_that_is_no_distribution(gridworld, value, sentence):
    mdp, starts, table = gridworld.problem.mdp, np.full(25, 0.04), gridworld.probabilities
    policy, size = uniform(mdp), {"n_episodes": 2, "n_steps": 2, "rng": np.random.default_rng(0)}
    policy[3, 1] = value
    with pytest.raises(SerdError, match=sentence):
        policy_log_likelihood(gridworld.problem, gridworld.decisions, policy)
    with pytest.raises(SerdError, match=sentence):
        state_action_occupancy(mdp, transitions_of(mdp.transitions, table), policy, starts)
    with pytest.raises(SerdError, match=sentence):
        sample_decisions(mdp, policy, table, starts, **size)


def test_actions_that_are_not_available_have_no_probability(minimum_example):
    mdp = minimum_example.mdp
    share = uniform(mdp)
    np.testing.assert_array_equal(checked_policy("policy", share, mdp), share)
    state, action = np.argwhere(~mdp.available)[0]
    share[state, action] = 0.1
    with pytest.raises(SerdError, match=rf"policy\[{state}, {action}\] must be a probability of"):
        checked_policy("policy", share, mdp)


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
