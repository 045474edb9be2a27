"""Cell crossings of a policy as a semi-Markov chain."""

import numpy as np
import pytest

from serd_core.arrival.chain import arrival_by_state, policy_chain
from serd_core.arrival.crossing_chain import (
    N_CLASSES,
    N_DIRECTIONS,
    cdf_after_first_moves,
    crossing_chain,
    crossing_moves,
    direction_of_move,
)
from serd_core.arrival.semi_markov import DwellTimes, semi_markov_arrival
from serd_core.grid.grid import Action, Grid
from serd_core.policies.solved_policy import soft_policy
from support.small_problems import always, room

TABLE = np.array(
    [
        [0.2, 0.6, 0.1, 0.02, 0.08],
        [0.5, 0.3, 0.1, 0.05, 0.05],
        [0.3, 0.5, 0.05, 0.05, 0.1],
        [0.9, 0.04, 0.02, 0.02, 0.02],
    ]
)


def test_directions_lead_to_the_neighbour_and_other_moves_have_none():
    grid = Grid((0.0, 0.0), 1.0, np.ones((3, 3), dtype=bool))
    middle = grid.state_at(1.5, 1.5)
    for action in Action:
        there = grid.neighbours[middle, action]
        assert direction_of_move(grid, np.array([middle]), np.array([there]))[0] == action
    corner = grid.state_at(0.5, 0.5)
    assert direction_of_move(grid, np.array([middle]), np.array([corner]))[0] == Action.WAIT


def test_moves_are_those_of_the_chain_given_that_the_cell_is_left():
    problem = room(3, 4, 7, Action.EAST)
    policy = soft_policy(problem, [3.0, 0.5, 0.0], TABLE).probabilities
    dense = policy_chain(problem.mdp, policy, TABLE).toarray()
    moves = crossing_moves(problem, policy, TABLE)
    expected = dense * (1 - np.eye(len(dense)))
    expected /= expected.sum(axis=1, keepdims=True) + (dense.diagonal() == 1.0)[:, None]
    found = np.zeros_like(dense)
    found[moves.state, moves.successor] = moves.probability
    assert found == pytest.approx(expected, abs=1e-12)
    neighbours = problem.grid.neighbours
    assert np.array_equal(neighbours[moves.state, moves.direction], moves.successor)


def test_stays_of_the_periodic_law_are_geometric_dwell_times():
    """In a lane whose cells are left ahead only, both laws are the same in every period."""
    problem, table = room(1, 6, 5, Action.EAST), np.tile([0.3, 0.7, 0.0, 0.0, 0.0], (4, 1))
    policy, n = always(problem, Action.EAST), 40
    periods = arrival_by_state(problem, policy, table, n)
    geometric = 0.7 * 0.3 ** np.arange(-1.0, n)
    geometric[0] = 0.0
    chain = crossing_chain(crossing_moves(problem, policy, table))
    found = semi_markov_arrival(chain, DwellTimes(1.0, np.tile(geometric, (N_CLASSES, 1))), n)
    entered_east = N_DIRECTIONS * np.arange(6) + Action.EAST - 1
    assert found.cdf[:, entered_east] == pytest.approx(periods.cdf, abs=1e-6)


def test_a_cell_that_is_never_left_never_arrives():
    problem = room(1, 4, 3, Action.EAST)
    policy = always(problem, Action.EAST)
    policy[1] = np.eye(len(Action))[Action.WAIT]
    table = TABLE.copy()
    table[3] = [1.0, 0.0, 0.0, 0.0, 0.0]
    table[0] = [0.2, 0.8, 0.0, 0.0, 0.0]
    chain = crossing_chain(crossing_moves(problem, policy, table))
    masses = np.tile([0.0, 1.0], (N_CLASSES, 1))
    found = semi_markov_arrival(chain, DwellTimes(1.0, masses), 30)
    assert found.cdf[-1].reshape(4, -1).max(axis=1) == pytest.approx([0, 0, 1, 1], abs=1e-7)
    assert found.arrival_probability.reshape(4, -1)[:, 0].tolist() == [0, 0, 1, 1]


def test_arrival_agrees_with_simulated_crossings():
    """Another dwell time for each class, so that a wrong class, turn or first move would differ."""
    flow = np.full(9, Action.EAST)
    flow[::2] = Action.NORTH
    problem = room(3, 3, 8, flow)
    policy = soft_policy(problem, [3.0, 0.5, 0.0], TABLE).probabilities
    moves = crossing_moves(problem, policy, TABLE)
    own_time, first_time = np.arange(1, N_CLASSES + 1), 9
    n_steps, rng = 120, np.random.default_rng(5)
    masses = np.eye(N_CLASSES + 1)[own_time]
    arrival = semi_markov_arrival(crossing_chain(moves), DwellTimes(1.0, masses), n_steps)
    share = np.eye(9)[0]
    first = np.eye(10)[[first_time]]
    cdf = cdf_after_first_moves(moves, share, first, np.zeros(len(moves.state), int), arrival)
    times = []
    for _ in range(4000):
        cell, entered, time = 0, 0, 0
        while cell != 8:
            mine = np.flatnonzero(moves.state == cell)
            move = rng.choice(mine, p=moves.probability[mine])
            turning = moves.direction[move] != entered
            time += own_time[2 * moves.model[move] + turning] if entered else first_time
            cell, entered = moves.successor[move], moves.direction[move]
        times.append(time)
    measured = np.searchsorted(np.sort(times), np.arange(n_steps + 1), side="right") / len(times)
    assert np.abs(measured - cdf).max() < 1.63 / np.sqrt(len(times))  # 1 % of Kolmogorov's law
