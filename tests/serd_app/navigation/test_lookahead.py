"""Cells ahead on the way the policy most probably takes."""

import numpy as np
import pytest

from serd_app.navigation.navigator import Navigator
from serd_app.navigation.settings import NavigationSettings
from serd_app.navigation.strategy import load_strategy
from serd_core.grid.grid import Action
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")


@pytest.fixture
def strategy(save_model_of):
    return load_strategy(str(save_model_of()), HALLWAY, "optimal")


def test_one_cell_ahead_is_the_next_cell_from_everywhere(strategy):
    for state, action in enumerate(strategy.policy.greedy):
        ahead = strategy.cell_ahead(state, Action(int(action)), 1)
        assert ahead == strategy.problem.grid.neighbours[state, action]


def test_the_likeliest_next_cell_is_that_of_the_largest_summed_outcome(strategy):
    """Against a sum over all outcomes by hand."""
    problem, table = strategy.problem, strategy.outcome_probabilities
    models = problem.outcome_models
    for state, found in enumerate(strategy.likeliest_next):
        action = int(strategy.policy.greedy[state])
        chances = np.zeros(problem.mdp.n_states)
        row = table[models.model_of[state, action]]
        np.add.at(chances, models.successors[state, action], row)
        chances[state] = 0.0
        if chances.any():
            assert chances[found] == pytest.approx(chances.max())
        else:
            assert found == state


def test_farther_ahead_goes_straight_on_and_stops_before_a_turn_and_at_the_goal(strategy):
    grid = strategy.problem.grid
    goals = set(strategy.problem.goal_states.tolist())
    farther = 0
    for state in range(grid.n_states):
        action = Action(int(strategy.policy.greedy[state]))
        ahead = strategy.cell_ahead(state, action, 3)
        step = grid.cells[ahead] - grid.cells[state]
        assert np.count_nonzero(step) <= 1
        assert np.abs(step).sum() <= 3
        path = [state]
        while path[-1] != ahead:
            path.append(int(grid.neighbours[path[-1], action]))
        assert not goals & set(path[:-1]) or state in goals
        assert all(strategy.policy.greedy[cell] == action for cell in path[1:-1])
        farther += len(path) == 4
    assert farther > grid.n_states / 3


def test_the_navigator_sends_the_robot_as_far_ahead_as_it_is_told(save_model_of):
    path = save_model_of()
    centre = {}
    for cells in (1, 2, 3):
        settings = NavigationSettings(model=str(path), lookahead_cells=cells)
        navigator = Navigator(HALLWAY, settings)
        navigator.begin(0)
        observation = observation_at(4.5, 5.5)
        action = navigator.decide(observation)
        assert action == Action.NORTH
        centre[cells] = navigator.waypoint_of(observation, action)
    assert [(each.x_m, each.y_m) for each in centre.values()] == [
        (4.5, 6.5),
        (4.5, 7.5),
        (4.5, 8.5),
    ]
