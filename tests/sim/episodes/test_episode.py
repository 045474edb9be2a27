"""Whole episodes: the expert arrives, the world answers sanely, and it all repeats."""

import math
from itertools import cycle

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_sim.drivers.catalogue import ScriptedExpert, make_driver
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.episodes.episode import run_episode
from serd_sim.errors import SimError
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import Obstacle
from serd_sim.world.epochs import LEAST_DWELL_S
from serd_sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway")


@pytest.fixture(scope="module")
def demonstrations():
    with HallwayWorld(HALLWAY, seed=1) as world:
        planner, expert = make_planner(HALLWAY), ScriptedExpert(HALLWAY, 1)
        return world.grid, [
            run_episode(world, planner, expert, episode=episode) for episode in range(3)
        ]


def test_the_expert_arrives_touches_nobody_and_seldom_stands(demonstrations):
    grid, records = demonstrations
    decisions = [record.decisions for record in records]
    for record in records:
        assert record.outcome == "arrived"
        assert record.time_of_arrival_s < 60.0
        assert grid.centers_m[record.decisions.next_state[-1]][0] > 11
        assert (record.contacts.robot_on_wall, record.contacts.robot_on_person) == (0, 0)
    action, state, to, dwell_s = (
        np.concatenate([getattr(each, name) for each in decisions])
        for name in ("action", "state", "next_state", "dwell_s")
    )
    move = action != Action.WAIT
    assert (grid.neighbours[state, action] == to)[move].mean() > 0.9
    assert 0 < dwell_s[~move].sum() / dwell_s.sum() < 0.2


def test_decisions_follow_each_other_and_last_at_most_the_patience(demonstrations):
    """A wait has its own length; it begins between two observations and ends at one."""
    grid, records = demonstrations
    for record in records:
        decisions = record.decisions
        ended_s = decisions.time_s + decisions.dwell_s
        np.testing.assert_allclose(decisions.time_s[1:], ended_s[:-1], atol=LEAST_DWELL_S)
        assert np.array_equal(decisions.state[1:], decisions.next_state[:-1])
        near = grid.neighbours[decisions.state] == decisions.next_state[:, None]
        assert near.any(axis=1).all()
        assert not decisions.censored.any()
        waits = decisions.action == Action.WAIT
        longest_s = np.where(waits, HALLWAY.wait_s, HALLWAY.patience_s)
        assert np.all(decisions.dwell_s <= longest_s + HALLWAY.control_period_s)
        late_s = (
            decisions.dwell_s[waits & (decisions.state == decisions.next_state)] - HALLWAY.wait_s
        )
        assert np.all((late_s > -1e-6) & (late_s < HALLWAY.control_period_s))


def drive(scenario, driver, *, seed=11, **options):
    with HallwayWorld(scenario, seed=seed) as world:
        return run_episode(world, make_planner(scenario), driver, episode=0, **options)


def test_where_nobody_is_blocked_a_drive_does_not_depend_on_patience_and_is_fast():
    empty, tracks = load_scenario("crossing").with_pedestrian_count(0), []
    for factor in (0.5, 2.0):
        scenario = empty.model_copy(update={"patience_s": factor * empty.patience_s})
        record = drive(scenario, make_driver("expert_with_flow", scenario, 11))
        assert record.outcome == "arrived"
        assert record.distance_m / record.duration_s > 0.8 * empty.robot.max_vel_x_mps
        decisions = record.decisions
        assert decisions.dwell_s.max() < 0.5 * empty.patience_s
        columns = decisions.time_s, decisions.state, decisions.action, decisions.dwell_s
        tracks.append((record.duration_s, record.distance_m, np.array(columns).tolist()))
    assert tracks[0] == tracks[1]


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
