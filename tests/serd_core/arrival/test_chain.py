from dataclasses import dataclass

import numpy as np
import pytest

import serd_core as sc
from serd_core.arrival.chain import arrival_time_distribution
from serd_core.errors import SerdError
from serd_core.grid.grid import Action
from support.small_problems import always, room


def outcomes(forward):
    """Go forward with that probability, else stay, whatever the model."""
    return np.tile([1 - forward, forward, 0, 0, 0], (4, 1))


def test_certain_moves_arrive_after_as_many_periods_as_cells():
    problem = room(6, 1, 5)
    arrival = arrival_time_distribution(
        problem, always(problem, Action.NORTH), outcomes(1.0), np.eye(6)[0], 7
    )
    np.testing.assert_allclose(arrival.cdf, [0, 0, 0, 0, 0, 1, 1, 1])
    assert arrival.arrival_probability == pytest.approx(1.0)


def test_one_step_to_go_gives_the_geometric_distribution():
    problem = room(6, 1, 5)
    arrival = arrival_time_distribution(
        problem, always(problem, Action.NORTH), outcomes(0.3), np.eye(6)[4], 20
    )
    np.testing.assert_allclose(arrival.cdf, 1 - 0.7 ** np.arange(21), atol=1e-12)


def test_a_trap_is_left_out_of_the_probability_of_ever_arriving():
    """Forward 0.6, back 0.4; below cell 2 the policy walks away: gambler's ruin."""
    problem = room(6, 1, 5)
    table = np.tile([0, 0.6, 0, 0.4, 0], (4, 1))
    policy = always(problem, Action.NORTH)
    policy[:2] = np.eye(5)[Action.WAIT]
    table[3] = [1, 0, 0, 0, 0]
    arrival = arrival_time_distribution(problem, policy, table, np.eye(6)[2], 500)
    ratio = 0.4 / 0.6
    assert arrival.arrival_probability == pytest.approx((1 - ratio) / (1 - ratio**4))
    assert arrival.cdf[-1] == pytest.approx(arrival.arrival_probability)


def test_wrong_arguments_are_refused_by_name():
    problem = room(6, 1, 5)
    good = always(problem, Action.NORTH)
    start = np.eye(6)[0]
    with pytest.raises(SerdError, match=r"start_distribution must sum to 1, got a sum of 2.0"):
        arrival_time_distribution(problem, good, outcomes(0.5), start * 2, 3)
    with pytest.raises(SerdError, match=r"policy\[5, 1\] must be a probability of an available"):
        arrival_time_distribution(problem, np.tile(np.eye(5)[1], (6, 1)), outcomes(1), start, 3)
    with pytest.raises(SerdError, match=r"policy\[0\] must sum to 1, got 0.5"):
        arrival_time_distribution(problem, good * 0.5, outcomes(1), start, 3)
    with pytest.raises(SerdError, match="n_decisions must be a whole number of at least 0, got -1"):
        arrival_time_distribution(problem, good, outcomes(1), start, -1)
    with pytest.raises(SerdError, match=r"n_decisions must be a whole number .* got 30\.5"):
        arrival_time_distribution(problem, good, outcomes(1), start, 30.5)


def test_what_starts_at_the_goal_has_arrived_once_and_for_all():
    problem = room(6, 1, 5)
    half = np.array([0.5, 0, 0, 0, 0, 0.5])
    arrival = arrival_time_distribution(
        problem, always(problem, Action.NORTH), outcomes(1.0), half, 6
    )
    np.testing.assert_allclose(arrival.cdf, [0.5, 0.5, 0.5, 0.5, 0.5, 1.0, 1.0])


@dataclass
class GoalsOf:
    mdp: sc.Mdp
    goal_states: list


def test_known_transitions_need_no_probabilities_and_goals_must_be_states():
    world = sc.from_transitions(np.full((2, 1, 2), 0.5), np.ones((2, 1)), discount=0.9)
    given = (np.ones((2, 1)), None, np.array([1.0, 0.0]), 2)
    arrival = arrival_time_distribution(GoalsOf(world.mdp, [1]), *given)
    np.testing.assert_allclose(arrival.cdf, [0.0, 0.5, 0.75])
    with pytest.raises(SerdError, match="problem must have an mdp and goal_states, got a Tabular"):
        arrival_time_distribution(world, *given)
    for goal in (99, -1):
        with pytest.raises(SerdError, match=rf"goal_states\[0\] must be a state .* got {goal}"):
            arrival_time_distribution(GoalsOf(world.mdp, [goal]), *given)
