"""Any walkable cell as the goal: of a scenario, of a world, of an episode."""

import pytest

from serd_sim.episodes.episode import EpisodeProgress
from serd_sim.errors import SimError
from serd_sim.scenario.grid import goal_at, goal_cell, goal_states_of, grid_of, point_of, with_goal
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at

HALLWAY = load_scenario("hallway")
GRID = grid_of(HALLWAY)


def test_every_cell_can_be_the_goal_and_is_then_the_only_goal_state():
    for state, (x_m, y_m) in enumerate(GRID.centers_m):
        moved = goal_at(HALLWAY, x_m, y_m)
        assert goal_states_of(moved, GRID).tolist() == [state]
        assert HALLWAY.goal_area_m != moved.goal_area_m


@pytest.mark.parametrize(
    ("point", "sentence"),
    [
        ((9.0, 3.0), r"walkable cell, got \(9, 3\) m; the nearest one is at \(5.5, 2.5\)"),
        ((-0.1, 3.0), r"walkable cell, got \(-0.1, 3\) m; the nearest one is at \(0.5, "),
        ((float("nan"), 3.0), r"two finite numbers \(m\), got \(nan, 3.0\); set a point"),
    ],
)
def test_a_goal_that_is_no_place_to_go_is_refused_with_the_nearest_one(point, sentence):
    with pytest.raises(SimError, match=sentence):
        goal_cell(GRID, *point)


def test_a_goal_in_words_is_two_numbers_and_nothing_keeps_the_scenarios_own():
    assert point_of(" 3.5,20.5 ") == (3.5, 20.5)
    assert with_goal(HALLWAY, "") is HALLWAY
    assert with_goal(HALLWAY, "3.4, 20.9") == goal_at(HALLWAY, 3.5, 20.5)
    for text in ("3.5", "north", "1,2,3"):
        with pytest.raises(SimError, match="goal must be two numbers 'x, y'"):
            point_of(text)


def test_an_episode_ends_in_the_goal_that_is_moved_while_the_robot_drives():
    progress = EpisodeProgress(goal_at(HALLWAY, 0.5, 5.5), observation_at(0.5, 1.0), 60.0)
    assert progress.see(observation_at(0.5, 4.5, tick=1)) is None
    progress.goal_area_m = goal_at(HALLWAY, 0.5, 7.5).goal_area_m
    assert progress.see(observation_at(0.5, 5.5, tick=2)) is None
    assert progress.see(observation_at(0.5, 7.5, tick=3)) == "arrived"
    assert (progress.distance_m, progress.duration_s) == (6.5, pytest.approx(0.15))
