from types import SimpleNamespace

import numpy as np
import pytest

import serd_core as sc
from serd_core.arrival.chain import ArrivalByState, arrival_time_distribution
from support.arrival_twin import arrival_by_state
from support.small_problems import room


def test_the_distribution_is_that_of_the_start_by_the_arrival_from_each_state():
    rng, problem = np.random.default_rng(3), room(4, 3, 7, np.arange(12) % 4 + 1)
    policy, table = rng.dirichlet(np.ones(5), 12), rng.dirichlet(np.ones(5), 4)
    policy[7], start = np.eye(5)[0], rng.dirichlet(np.ones(12))
    every = arrival_by_state(problem, policy, table, 30)
    found = arrival_time_distribution(problem, policy, table, start, 30)
    np.testing.assert_allclose(found.cdf, every.cdf @ start, atol=1e-12)
    assert found.arrival_probability == pytest.approx(every.arrival_probability @ start)


def test_known_transitions_need_no_probabilities_and_goals_must_be_states():
    world = sc.from_transitions(np.full((2, 1, 2), 0.5), np.ones((2, 1)), discount=0.9)
    given = (np.ones((2, 1)), None, np.array([1.0, 0.0]), 2)
    goal = SimpleNamespace(mdp=world.mdp, goal_states=[1])
    np.testing.assert_allclose(arrival_time_distribution(goal, *given).cdf, [0.0, 0.5, 0.75])
    with pytest.raises(sc.SerdError, match="problem must have an mdp and goal_states, got a Tab"):
        arrival_time_distribution(world, *given)
    for wrong in (99, -1):
        with pytest.raises(sc.SerdError, match=rf"goal_states\[0\] must be a state .* got {wrong}"):
            arrival_time_distribution(SimpleNamespace(mdp=world.mdp, goal_states=[wrong]), *given)


def test_the_mean_is_that_of_the_law_cut_off_at_the_horizon_as_are_probabilities():
    cdf = np.array([[0.0, 1.0], [0.25, 1.0], [0.75, 1.0]])
    found = ArrivalByState(cdf, np.array([0.9, 1.0]))
    np.testing.assert_allclose(found.mean_steps, [0.25 * 1 + 0.5 * 2 + 0.25 * 2, 0.0])
    assert [found.within(n).tolist() for n in (-1, 1, 99)] == cdf.tolist()
    both = ArrivalByState.average([found, ArrivalByState(np.ones((3, 2)), np.ones(2))])
    np.testing.assert_allclose(both.cdf, (cdf + 1.0) / 2.0)
    np.testing.assert_allclose(both.arrival_probability, [0.95, 1.0])
