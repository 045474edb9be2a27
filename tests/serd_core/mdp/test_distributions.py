import numpy as np
import pytest

from serd_core.demonstrations.simulation import sample_decisions
from serd_core.dynamics.transition_model import transitions_of
from serd_core.errors import SerdError
from serd_core.learners.mdce_irl import state_action_occupancy
from serd_core.mdp.mdp import checked_distribution, checked_policy
from serd_core.selection.evaluation import policy_log_likelihood


@pytest.fixture
def uniform():
    return np.full((25, 5), 0.2)


@pytest.mark.parametrize(
    ("place", "value", "sentence"),
    [
        ((3, 1), 0.7, r"policy\[3\] must sum to 1, got 1.4\d+; normalise over actions"),
        ((3, 1), -0.2, r"policy\[3, 1\] must be a probability of an available action, got -0.2"),
        ((3, 1), np.nan, r"policy\[3, 1\] must be finite, got nan"),
    ],
)
def test_every_use_of_a_policy_refuses_a_row_that_is_no_distribution(
    gridworld, uniform, place, value, sentence
):
    mdp, starts = gridworld.problem.mdp, np.full(25, 0.04)
    uniform[place] = value
    uses = [
        lambda: policy_log_likelihood(gridworld.problem, gridworld.decisions, uniform),
        lambda: state_action_occupancy(
            mdp, transitions_of(mdp.transitions, gridworld.probabilities), uniform, starts
        ),
        lambda: sample_decisions(
            mdp,
            uniform,
            gridworld.probabilities,
            starts,
            n_episodes=2,
            n_steps=2,
            rng=np.random.default_rng(0),
        ),
    ]
    for use in uses:
        with pytest.raises(SerdError, match=sentence):
            use()


def test_actions_that_are_not_available_have_no_probability(minimum_example):
    mdp = minimum_example.mdp
    share = mdp.available / mdp.available.sum(axis=1, keepdims=True)
    np.testing.assert_array_equal(checked_policy("policy", share, mdp), share)
    state, action = np.argwhere(~mdp.available)[0]
    share[state, action] = 0.1
    with pytest.raises(SerdError, match=rf"policy\[{state}, {action}\] must be a probability of"):
        checked_policy("policy", share, mdp)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ([0.5, 0.6], "starts must sum to 1, got a sum of 1.1; normalise it"),
        ([1.5, -0.5], r"starts\[1\] must not be negative, got -0.5"),
        ([1.0, np.nan], r"starts\[1\] must be finite, got nan"),
        ([1.0], r"starts must have shape \(2\), got \(1,\)"),
    ],
)
def test_what_is_no_distribution_is_refused_with_the_place(values, sentence):
    with pytest.raises(SerdError, match=sentence):
        checked_distribution("starts", np.array(values), 2)


def test_rounded_tables_are_taken_as_they_are():
    third = np.array([0.3333333, 0.3333333, 0.3333334])
    np.testing.assert_array_equal(checked_distribution("starts", third, 3), third)
