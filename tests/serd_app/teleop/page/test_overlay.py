"""The overlay of a learned model, against shortest paths and the model's own numbers."""

import numpy as np

from serd_app.teleop.page.view import overlay_of, point
from serd_core.grid.grid import Action
from serd_sim.drivers.strategy import load_strategy
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint
from tests.conftest import MEAN_S, model_row

HALLWAY = load_scenario("hallway")


def overlay_and_strategy(path):
    strategy = load_strategy(str(path), HALLWAY, "optimal")
    return overlay_of(strategy), strategy


def with_moves(probabilities, **law):
    """Outcome models whose moves have these probabilities of the outcomes, and that wait surely."""
    moves = (model_row(name, probabilities).model_copy(update=law) for name in MEAN_S)
    return (*moves, model_row("waiting", (1.0, 0.0, 0.0, 0.0, 0.0)))


def n_cells_to_the_goal(problem):
    """(S,) length of the shortest path, by ever longer ways from the goal."""
    lengths = np.full(problem.grid.n_states, np.inf)
    lengths[problem.goal_states] = 0.0
    while np.isinf(lengths).any():
        lengths = np.minimum(lengths, 1.0 + lengths[problem.grid.neighbours].min(axis=1))
    return lengths


def test_where_every_move_succeeds_at_once_the_median_is_a_second_for_each_cell(save_model_of):
    sure = with_moves((0.0, 1.0, 0.0, 0.0, 0.0), mean_s=1.0, believed_mean_s=1.0, shape=1e6)
    path = save_model_of(reward_weights={"goal": 5.0}, outcome_models=sure)
    overlay, strategy = overlay_and_strategy(path)
    n_cells = n_cells_to_the_goal(strategy.problem)
    assert n_cells.max() > 10
    layer = overlay["arrival"]
    assert layer["labels"] == [f"{count:.0f}" for count in n_cells]
    np.testing.assert_allclose(layer["shades"], n_cells / n_cells.max(), atol=0.006)
    stuck = with_moves((1.0, 0.0, 0.0, 0.0, 0.0))
    nobody, _ = overlay_and_strategy(save_model_of(outcome_models=stuck))
    assert nobody["arrival"]["labels"] == ["0" if count == 0 else "×" for count in n_cells]


def test_directions_are_those_of_the_greedy_moves(save_model_of):
    overlay, strategy = overlay_and_strategy(save_model_of())
    grid, greedy = strategy.problem.grid, strategy.policy.greedy
    directions = np.array(overlay["policy"]["directions"])
    following = grid.neighbours[np.arange(grid.n_states), greedy]
    moved = following != np.arange(grid.n_states)
    step_m = (grid.centers_m[following] - grid.centers_m)[moved]
    np.testing.assert_allclose(step_m, grid.cell_size_m * directions[moved])
    assert moved.sum() > 50
    assert not directions[greedy == Action.WAIT].any()


def test_a_waypoint_is_a_point_in_millimetres():
    assert point(Waypoint(1.23456, -2.0)) == [1.235, -2.0]
    assert point(None) is None
