"""Drives with goals of their own are learned from together, and nearly all decisions are used."""

from dataclasses import replace

import numpy as np
import pytest

from serd_app.demonstrations.decision_table import (
    Place,
    concatenate_renumbered,
    save_learnable,
)
from serd_app.learning.learning_files import read_learning_files, until_goal
from serd_app.learning.recipe import learn
from serd_app.learning.settings import LearningSettings
from serd_app.learning.several_goals import GoalDrives, in_one_problem
from serd_core.demonstrations.simulation import sample_timed_decisions
from serd_core.grid.grid import Grid, grid_wall_distance_m
from serd_core.grid.navigation import NO_FLOW, build_navigation_problem, with_dwell_times
from serd_core.policies.solved_policy import soft_policy
from serd_core.semi_markov.models import require_timed

N = 9
WEIGHTS = np.array([4.0, 0.0])


def to_side(grid, side):
    """The problem whose goal is a side of a square, and drives from the opposite one."""
    x, y = grid.cells[:, 1], grid.cells[:, 0]
    at = {"n": y == N - 1, "s": y == 0, "e": x == N - 1, "w": x == 0}
    goal, start = at[side], at[{"n": "s", "s": "n", "e": "w", "w": "e"}[side]]
    problem = with_dwell_times(
        build_navigation_problem(
            grid=grid,
            flow=np.full(grid.n_states, NO_FLOW),
            goal_states=np.flatnonzero(goal),
            wall_distance_m=grid_wall_distance_m(grid),
            discount=0.97,
        ),
        patience_s=4.0,
        wait_s=1.0,
    )
    model = require_timed(problem.mdp.transitions)
    table = np.tile([0.05, 0.85, 0.05, 0.01, 0.04], (len(problem.model_names), 1))
    table[-1] = [0.96, 0.01, 0.01, 0.01, 0.01]
    truth = model.parameters_from(table, 1.0, 6.0)
    policy = soft_policy(problem, WEIGHTS, model.local_probabilities(truth)).probabilities
    decisions = sample_timed_decisions(
        problem.mdp, policy, truth, start / start.sum(), n_episodes=10, n_steps=200,
        rng=np.random.default_rng(ord(side)), mean_until_command_s=60.0,
    )  # fmt: skip
    return GoalDrives(problem, replace(decisions, source=side))


@pytest.fixture(scope="module")
def crossing(tmp_path_factory):
    """A table of drives from each side of a square to the opposite one."""
    grid = Grid((0.0, 0.0), 1.0, np.ones((N, N), dtype=bool))
    goals = [to_side(grid, side) for side in "nsew"]
    table = tmp_path_factory.mktemp("square") / "decisions.csv"
    decisions = concatenate_renumbered([each.decisions for each in goals])
    save_learnable(table, Place(grid, 4.0, 1.0), decisions)
    return goals, table


def test_stacked_problems_have_the_policies_of_each_goal(crossing):
    goals, _ = crossing
    problem, decisions = in_one_problem(goals)
    assert len(decisions) == sum(len(each.decisions) for each in goals)
    model = require_timed(problem.mdp.transitions)
    table = np.tile([0.1, 0.8, 0.04, 0.02, 0.04], (len(problem.model_names), 1))
    local = model.local_probabilities(model.parameters_from(table, 1.2, 5.0))
    whole = soft_policy(problem, WEIGHTS, local).probabilities
    for k, goal in enumerate(goals):
        alone = soft_policy(goal.problem, WEIGHTS, local).probabilities
        np.testing.assert_allclose(whole[k * N * N : (k + 1) * N * N], alone, atol=1e-8)


def test_nearly_all_decisions_of_a_square_are_used_and_give_its_reward(crossing):
    _, table = crossing
    files = read_learning_files(table, discount=0.97)
    outcome = learn(files.task, files.decisions, LearningSettings(discount=0.97))
    assert len(outcome.decisions) >= 0.9 * files.n_read
    assert len(outcome.decisions) + files.n_after_goal + files.n_elsewhere == files.n_read
    assert len(files.task.other_drives) >= 3
    assert 2.0 < outcome.model.reward_weights["goal"] < 8.0
    assert len(outcome.knowledge.gains) == N * N


def test_decisions_end_at_the_goal_also_where_episodes_are_mixed(crossing):
    goals, _ = crossing
    decisions, goal = goals[0].decisions, np.arange(40, 50)
    kept = []
    for episode in decisions.episodes:
        over = False
        for row in np.flatnonzero(decisions.episode == episode):
            over |= bool(decisions.state[row] in goal)
            kept += [] if over else [row]
            over |= bool(decisions.next_state[row] in goal)
    np.testing.assert_array_equal(
        until_goal(decisions, goal).time_s, decisions.select(np.sort(kept)).time_s
    )
