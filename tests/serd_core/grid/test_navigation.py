import numpy as np

from serd_core.grid.grid import Action, Grid, Outcome
from serd_core.grid.navigation import (
    FEATURE_NAMES,
    MODEL_NAMES,
    NO_FLOW,
    build_navigation_problem,
    features_of_flow,
)
from support.refusals import refusals

N, E, S, W = Action.NORTH, Action.EAST, Action.SOUTH, Action.WEST


def corridor(**changes):
    """Two columns of four cells: people walk north on the right and south on the left."""
    grid = Grid(origin_m=(0.0, 0.0), cell_size_m=1.0, walkable=np.ones((4, 2), bool))
    arguments = {
        "grid": grid,
        "flow": np.array([S, N, S, N, -1, -1, S, N]),
        "goal_states": [6],
        "wall_distance_m": np.array([0.5, 1.0] * 4),
        "discount": 0.9,
    }
    return build_navigation_problem(**(arguments | changes))


def test_outcomes_turn_clockwise_from_the_intended_direction():
    problem = corridor()
    reached = problem.outcome_models.successors[3, Action.NORTH]
    np.testing.assert_array_equal(reached, [3, 5, 3, 1, 2])
    reached = problem.outcome_models.successors[3, Action.WEST]
    assert reached[Outcome.FORWARD] == 2
    assert reached[Outcome.RIGHT] == 5
    assert reached[Outcome.LEFT] == 1


def test_outcomes_of_waiting_are_relative_to_the_flow_and_north_without_one():
    successors = corridor().outcome_models.successors
    assert successors[2, Action.WAIT, Outcome.FORWARD] == 0
    assert successors[4, Action.WAIT, Outcome.FORWARD] == 6


def test_the_model_depends_on_how_the_action_lies_to_the_flow():
    model_of = corridor().outcome_models.model_of
    names = [MODEL_NAMES[model_of[3, action]] for action in (N, S, E, W, Action.WAIT)]
    assert names == ["with_flow", "against_flow", "across_flow", "across_flow", "waiting"]
    assert {MODEL_NAMES[model_of[4, action]] for action in (N, S, E, W)} == {"across_flow"}


def test_features_follow_section_5_1_3():
    problem = corridor()
    goal, norm, inverse = np.moveaxis(problem.features, 2, 0)
    assert goal.sum() == 5
    assert np.all(goal[6] == 1)
    np.testing.assert_array_equal(norm[3], [1, 1, 0, -1, 0])
    np.testing.assert_array_equal(norm[2], [1, -1, 0, 1, 0])
    np.testing.assert_array_equal(norm[4], [0, 0, 0, 0, 0])
    np.testing.assert_allclose(inverse[:, 0], [1.0, 0.5] * 4)


def test_where_no_people_walk_there_is_no_social_norm_to_keep():
    problem = corridor(flow=np.full(8, NO_FLOW))
    assert problem.feature_names == ("goal", "inverse_wall_distance")
    assert features_of_flow(problem.flow) == problem.feature_names
    assert (problem.features == problem.features[:, :1]).all()  # waiting is worth what moving is


STILL = np.full(8, NO_FLOW)
test_wrong_arguments_are_refused_by_name = refusals(
    (lambda: corridor(flow=np.full(8, 7)), r"flow\[0\] must be 1 to 4 .* got 7"),
    (lambda: corridor(flow=np.full(3, -1)), r"flow must have shape \(8\), got \(3,\)"),
    (lambda: corridor(goal_states=[]), "goal_states must name at least one state"),
    (lambda: corridor(goal_states=[8]), r"goal_states\[0\] must be a state from 0 to 7, got 8"),
    (lambda: corridor(wall_distance_m=np.zeros(8)), r"wall_distance_m\[0\] must be above 0"),
    (lambda: corridor(features=("gaol",)), "features must be among goal, .* got 'gaol'"),
    (
        lambda: corridor(flow=STILL, features=FEATURE_NAMES),
        "among goal, inverse_wall_distance, got 'social_norm'; without a flow of people there is n",
    ),
)
