"""Whole episodes: the expert arrives, the world answers sanely, and it all repeats."""

import math
from itertools import cycle

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_sim.drivers.catalogue import ScriptedExpert
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.episodes.episode import EpisodeProgress, run_episode
from serd_sim.errors import SimError
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import goal_at, goal_cell, goal_states_of, grid_of, point_of, with_goal
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import Obstacle
from serd_sim.world.world import HallwayWorld
from support.observations import observation_at

HALLWAY = load_scenario("hallway")


def drive(scenario, driver, *, seed=11, **options):
    with HallwayWorld(scenario, seed=seed) as world:
        return run_episode(world, make_planner(scenario), driver, episode=0, **options)


def test_a_blocked_robot_tries_another_way_instead_of_the_same_for_ever():
    """A policy that drives north alone, from where a table stands in its way."""
    table = Obstacle(name="table", outline_m=((0.0, 4.2), (4.8, 4.2), (4.8, 4.8), (0.0, 4.8)))
    scenario = HALLWAY.with_pedestrian_count(0).model_copy(
        update={"obstacles": (table,), "episode_timeout_s": 25.0}
    )
    policy = np.tile(np.eye(len(Action))[Action.NORTH], (grid_of(scenario).n_states, 1))
    record = drive(scenario, PolicyDriver(grid_of(scenario), policy, seed=3))
    decisions = record.decisions
    blocked = decisions.state == decisions.next_state
    again = blocked[:-1] & (decisions.action[1:] == decisions.action[:-1])
    assert blocked[:-1].sum() >= 2
    assert not again.any()


def test_a_waiting_policy_times_out_where_it_started():
    kinematic = HALLWAY.with_values("robot", drive="kinematic")  # a body settles on its casters
    grid = grid_of(kinematic)
    waits = PolicyDriver(grid, np.tile(np.eye(len(Action))[Action.WAIT], (grid.n_states, 1)))
    record = drive(kinematic, waits, timeout_s=9.5)
    assert (record.outcome, record.n_ticks) == ("timeout", 190)
    assert np.isnan(record.time_of_arrival_s)
    assert record.distance_m < 1e-6
    assert record.decisions.censored.tolist() == [False] * 9 + [True]
    np.testing.assert_allclose(record.decisions.dwell_s, [1.0] * 9 + [0.5])


def test_an_observer_may_abort_and_sees_every_tick():
    seen = []

    def observer(observation, _command, _action):
        seen.append(observation.tick)
        return len(seen) < 30

    assert drive(HALLWAY, ScriptedExpert(HALLWAY, 2), observer=observer).outcome == "aborted"
    assert seen == list(range(30))


class Mine:
    """A planner and a driver that give what neither may give."""

    name, is_blocked = "mine", False

    def __init__(self, wrong):
        self.step = self.decide = lambda *_: wrong
        self.reset = self.begin = lambda *_: None


@pytest.mark.parametrize("wrong", [None, (0.1, 0.0), 5, math.nan])
def test_a_planner_without_a_command_and_a_driver_without_an_action_are_named(wrong):
    planner, driver = make_planner(HALLWAY), ScriptedExpert(HALLWAY, 2)
    with HallwayWorld(HALLWAY, seed=2) as world:
        with pytest.raises(SimError, match=r"step of Mine must return a Command, .* return STOP"):
            run_episode(world, Mine(wrong), driver, episode=0)
        with pytest.raises(SimError, match=r"decide of Mine must return an Action, one of 0 \(WAI"):
            run_episode(world, planner, Mine(wrong), episode=0)


@pytest.mark.parametrize(
    ("name", "start_area"),
    list(zip(builtin_scenarios(), cycle(["transfer", "train"]), strict=False)),
)
def test_the_expert_arrives_in_every_built_in_scenario(name, start_area):
    scenario = load_scenario(name)
    record = drive(scenario, ScriptedExpert(scenario, 5), seed=5, start_area=start_area)
    assert record.outcome == "arrived"
    assert record.contacts.robot_on_wall == 0


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
