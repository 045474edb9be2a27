from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import gamma, nbinom

from serd_core import memory
from serd_core.arrival.semi_markov import (
    DwellTimes,
    RenewalChain,
    renewal_chain,
    semi_markov_arrival,
)
from serd_core.errors import SerdError
from support.arrival_twin import arrival_by_state
from support.small_problems import room


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


def any_policy(problem, seed):
    rng = np.random.default_rng(seed)
    weights = np.where(problem.mdp.available, rng.gamma(1.0, size=problem.mdp.available.shape), 0)
    return weights / weights.sum(axis=1, keepdims=True)


def test_equal_periods_give_the_arrival_of_decision_periods():
    seed = 2
    problem = room(7, 3, 20)
    table = np.random.default_rng(seed).dirichlet(np.ones(5), 4)
    policy = any_policy(problem, seed)
    expected = arrival_by_state(problem, policy, table, 60)
    found = semi_markov_arrival(renewal_chain(problem, policy, table), one_step(2.0), 60)
    np.testing.assert_allclose(found.cdf, expected.cdf, atol=3e-8)
    np.testing.assert_allclose(found.arrival_probability, expected.arrival_probability)


def test_moves_of_gamma_times_add_up_to_a_gamma_distribution():
    step_s, shape, scale_s = 0.05, 4.0, 0.25
    edges = (np.arange(400) + 0.5) * step_s
    cdf = gamma(shape, scale=scale_s).cdf(edges)
    dwell = DwellTimes(step_s, np.diff(np.concatenate([[0.0], cdf]))[None])
    found = semi_markov_arrival(line(5), dwell, 300).cdf[:, 0]
    np.testing.assert_allclose(found, gamma(5 * shape, scale=scale_s).cdf(edges[:301]), atol=2e-4)


def test_waits_of_chance_give_the_negative_binomial_distribution():
    state, successor = np.repeat(np.arange(3), 2), np.array([0, 1, 1, 2, 2, 3])
    chain = RenewalChain(
        state, successor, np.tile([0.6, 0.4], 3), np.zeros(6, int), np.arange(4) == 3
    )
    found = semi_markov_arrival(chain, one_step(1.0), 40).cdf[:, 0]
    np.testing.assert_allclose(found, nbinom(3, 0.4).cdf(np.arange(41) - 3), atol=3e-8)


def test_each_class_of_moves_has_its_own_time():
    dwell = DwellTimes(1.0, np.array([[0, 1, 0, 0], [0, 0, 0, 1.0]]))
    found = semi_markov_arrival(line(3, [0, 1, 1]), dwell, 10).cdf
    assert np.flatnonzero(found[:, 0] > 0.5)[0] == 7
    assert np.flatnonzero(found[:, 1] > 0.5)[0] == 6


def test_classes_follow_the_outcome_models():
    problem = room(7, 3, 20)
    policy, table = any_policy(problem, 1), np.random.default_rng(1).dirichlet(np.ones(5), 4)
    classes = np.tile([1, 0, 0, 0, 0], (4, 1))
    dwell = DwellTimes(1.0, np.array([[0, 1.0, 0], [0, 0, 1.0]]))
    chain = renewal_chain(problem, policy, table, classes)
    found = semi_markov_arrival(chain, dwell, 200)
    slower = semi_markov_arrival(
        renewal_chain(problem, policy, table), DwellTimes(1.0, np.array([[0, 0, 1.0]])), 200
    )
    faster = semi_markov_arrival(renewal_chain(problem, policy, table), one_step(1.0), 200)
    assert np.all(found.cdf <= faster.cdf + 1e-7)
    assert np.all(found.cdf >= slower.cdf - 1e-7)
    assert found.mean_steps[0] > faster.mean_steps[0] + 0.1


def test_a_table_that_would_not_fit_into_memory_is_refused(monkeypatch):
    problem = room(7, 3, 20)
    chain = renewal_chain(
        problem,
        problem.mdp.available / problem.mdp.available.sum(axis=1, keepdims=True),
        np.tile([0.1, 0.9, 0, 0, 0], (4, 1)),
    )
    monkeypatch.setattr(memory, "memory_limit", lambda: 60_000)
    with pytest.raises(SerdError, match="within 100 steps from each of 21 states must fit into"):
        semi_markov_arrival(chain, one_step(1.0), 100)
    assert semi_markov_arrival(chain, one_step(1.0), 50).cdf.shape == (51, 21)


def test_a_certain_loop_that_takes_no_time_is_rejected():
    chain = RenewalChain([0, 1], [0, 1], [1.0, 1.0], [0, 0], [False, True])
    with pytest.raises(SerdError, match="moves of the chain must take time"):
        semi_markov_arrival(chain, DwellTimes(1.0, np.array([[1.0]])), 5)


@pytest.mark.parametrize("goals", [[2], [False, False, True]])
def test_goals_are_numbers_or_a_mask(goals):
    problem = room(3, 1, 2)
    given = SimpleNamespace(mdp=problem.mdp, goal_states=goals)
    outcomes = np.full((4, 5), 0.2)
    chain = renewal_chain(given, any_policy(problem, 0), outcomes)
    assert chain.goal.tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"probability": [1.0, 0.5]}, r"moves from state 1 must sum to 1, got 0\.5"),
        (
            {"state": [0, 0], "probability": [1.5, -0.5]},
            r"probability\[1\] must not be negative, got",
        ),
    ],
)
def test_moves_that_are_no_distribution_are_rejected(change, sentence):
    given = {"state": [0, 1], "successor": [1, 2], "dwell": [0, 0], "goal": np.arange(3) == 2}
    with pytest.raises(SerdError, match=sentence):
        RenewalChain(**{key: np.array(value) for key, value in (given | change).items()})
    with pytest.raises(SerdError, match=r"mass\[1\] must be probabilities"):
        DwellTimes(0.1, np.array([[0, 1.0], [0.7, 0.7]]))
