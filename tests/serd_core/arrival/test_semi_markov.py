from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import gamma, nbinom

from serd_core import memory
from serd_core.arrival.semi_markov import (
    DwellTimes,
    RenewalChain,
    renewal_chain,
    semi_markov_arrival,
)
from serd_core.errors import SerdError
from serd_core.grid.grid import Action
from support.arrival_twin import arrival_by_state
from support.small_problems import always, room


def line(n_moves, dwell=None):
    """States 0 to n, each of which leads to the next one."""
    state = np.arange(n_moves)
    goal = np.zeros(n_moves + 1, bool)
    goal[-1] = True
    classes = np.zeros(n_moves, int) if dwell is None else np.asarray(dwell)
    return RenewalChain(state, state + 1, np.ones(n_moves), classes, goal)


def one_step(step_s):
    """Every move takes one step."""
    return DwellTimes(step_s, np.array([[0.0, 1.0]]))


def test_moves_of_gamma_times_add_up_to_a_gamma_distribution():
    step_s, shape, scale_s = 0.05, 4.0, 0.25
    edges = (np.arange(400) + 0.5) * step_s
    cdf = gamma(shape, scale=scale_s).cdf(edges)
    dwell = DwellTimes(step_s, np.diff(np.concatenate([[0.0], cdf]))[None])
    found = semi_markov_arrival(line(5), dwell, 300).cdf[:, 0]
    np.testing.assert_allclose(found, gamma(5 * shape, scale=scale_s).cdf(edges[:301]), atol=2e-4)


def test_each_class_of_moves_has_its_own_time():
    dwell = DwellTimes(1.0, np.array([[0, 1, 0, 0], [0, 0, 0, 1.0]]))
    found = semi_markov_arrival(line(3, [0, 1, 1]), dwell, 10).cdf
    assert np.flatnonzero(found[:, 0] > 0.5)[0] == 7
    assert np.flatnonzero(found[:, 1] > 0.5)[0] == 6


def case(seed):
    """A 4 x 3 room with random flow, goal, policy and outcomes."""
    rng = np.random.default_rng(seed)
    problem = room(4, 3, int(rng.integers(12)), rng.integers(1, 5, 12))
    policy = rng.dirichlet(np.ones(5), 12)
    policy[problem.goal_states] = np.eye(5)[Action.WAIT]
    return problem, policy, rng.dirichlet(np.ones(5), 4)


@settings(deadline=None, max_examples=8)
@given(st.integers(0, 10_000))
def test_equal_periods_give_the_chain_of_the_policy_run_backwards(seed):
    problem, policy, table = case(seed)
    expected = arrival_by_state(problem, policy, table, 60)
    found = semi_markov_arrival(renewal_chain(problem, policy, table), one_step(2.0), 60)
    np.testing.assert_allclose(found.cdf, expected.cdf, atol=3e-8)
    np.testing.assert_allclose(found.arrival_probability, expected.arrival_probability)


def test_the_remaining_time_through_a_corridor_is_negative_binomial():
    problem, table = room(6, 1, 5), np.tile([0.6, 0.4, 0, 0, 0], (4, 1))
    chain = renewal_chain(problem, always(problem, Action.NORTH), table)
    found = semi_markov_arrival(chain, one_step(1.0), 40)
    for state in range(5):
        expected = nbinom(5 - state, 0.4).cdf(np.arange(41) - 5 + state)
        np.testing.assert_allclose(found.cdf[:, state], expected, atol=3e-8)


def test_a_trap_is_left_out_of_the_probability_of_ever_arriving():
    """Forward 0.6, back 0.4; below cell 2 the policy stays: gambler's ruin."""
    problem, table = room(6, 1, 5), np.tile([0, 0.6, 0, 0.4, 0], (4, 1))
    policy, table[3] = always(problem, Action.NORTH), [1, 0, 0, 0, 0]
    policy[:2] = np.eye(5)[Action.WAIT]
    found = semi_markov_arrival(renewal_chain(problem, policy, table), one_step(1.0), 700)
    ratio = 0.4 / 0.6
    assert found.arrival_probability[2] == pytest.approx((1 - ratio) / (1 - ratio**4))
    assert found.cdf[-1, 2] == pytest.approx(found.arrival_probability[2], abs=1e-4)


def test_classes_follow_the_outcome_models():
    problem, policy, table = case(1)
    classes = np.tile([1, 0, 0, 0, 0], (4, 1))
    both = DwellTimes(1.0, np.array([[0, 1.0, 0], [0, 0, 1.0]]))
    found = semi_markov_arrival(renewal_chain(problem, policy, table, classes), both, 200)
    faster, slower = (
        semi_markov_arrival(renewal_chain(problem, policy, table), times, 200)
        for times in (one_step(1.0), DwellTimes(1.0, np.array([[0, 0, 1.0]])))
    )
    assert np.all(found.cdf <= faster.cdf + 1e-7)
    assert np.all(found.cdf >= slower.cdf - 1e-7)
    away = np.arange(12) != problem.goal_states[0]
    assert np.all(found.mean_steps[away] > faster.mean_steps[away] + 0.1)


def test_a_goal_that_can_be_left_counts_as_arrived_all_the_same():
    there_and_back = RenewalChain([0, 1], [1, 0], [1.0, 1.0], [0, 0], [False, True])
    found = semi_markov_arrival(there_and_back, one_step(1.0), 2)
    np.testing.assert_allclose(found.cdf, [[0, 1], [1, 1], [1, 1]], atol=3e-8)


def test_a_table_that_would_not_fit_into_memory_is_refused(monkeypatch):
    chain = renewal_chain(*case(0))
    monkeypatch.setattr(memory, "memory_limit", lambda: 30_000)
    with pytest.raises(SerdError, match="within 100 steps from each of 12 states must fit into"):
        semi_markov_arrival(chain, one_step(1.0), 100)
    assert semi_markov_arrival(chain, one_step(1.0), 50).cdf.shape == (51, 12)


@pytest.mark.parametrize("goals", [[2], [False, False, True]])
def test_goals_are_numbers_or_a_mask(goals):
    given = SimpleNamespace(mdp=room(3, 1, 2).mdp, goal_states=goals)
    chain = renewal_chain(given, always(room(3, 1, 2), Action.NORTH), np.full((4, 5), 0.2))
    assert chain.goal.tolist() == [False, False, True]


LAST = np.arange(3) == 2
LOOP = RenewalChain([0, 1], [0, 1], [1.0, 1.0], [0, 0], [False, True])
ROOM, OUTCOMES = room(6, 1, 5), np.full((4, 5), 0.2)
POLICY = always(ROOM, Action.NORTH)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: semi_markov_arrival(LOOP, DwellTimes(1.0, [[1.0]]), 5), "moves of the chain must"),
        (lambda: semi_markov_arrival(line(2), one_step(1.0), -1), "n_steps must not be negative"),
        (lambda: semi_markov_arrival(line(1, [1]), one_step(1.0), 1), "must be a class of dwell"),
        (lambda: RenewalChain([0, 1], [1, 2], [1, 0.5], [0, 0], LAST), "from state 1 must sum to"),
        (lambda: RenewalChain([0, 0], [1, 2], [2, -1], [0, 0], LAST), "ility.1. must not be neg"),
        (lambda: DwellTimes(0.1, [[0, 1.0], [0.7, 0.7]]), r"mass\[1\] must be probabilities"),
        (lambda: DwellTimes(0.0, [[0, 1.0]]), "step_s must be above 0 and finite"),
        (
            lambda: renewal_chain(ROOM, np.tile(np.eye(5)[1], (6, 1)), OUTCOMES),
            r"policy\[5, 1\] mu",
        ),
        (
            lambda: renewal_chain(ROOM, POLICY * 0.5, OUTCOMES),
            r"policy\[0\] must sum to 1, got 0.5",
        ),
    ],
)
def test_moves_and_times_that_are_no_distribution_are_rejected(call, sentence):
    with pytest.raises(SerdError, match=sentence):
        call()
