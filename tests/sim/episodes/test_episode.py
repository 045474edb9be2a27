"""Whole episodes: the expert arrives, the world answers sanely, and it all repeats."""

import math

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_sim.drivers.catalogue import make_driver
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.episodes.episode import run_episode
from serd_sim.errors import SimError
from serd_sim.planning.catalogue import make_planner
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
        planner, expert = make_planner("dwa", HALLWAY), ScriptedExpert(HALLWAY, 1)
        return world.grid, [
            run_episode(world, planner, expert, episode=episode) for episode in range(10)
        ]


def test_the_expert_arrives_in_nearly_all_episodes_and_touches_nobody(demonstrations):
    grid, records = demonstrations
    arrived = [record for record in records if record.outcome == "arrived"]
    assert len(arrived) >= 9
    assert max(record.time_of_arrival_s for record in arrived) < 60.0
    for record in arrived:
        assert grid.centers_m[record.decisions.next_state[-1]][0] > 11
    for record in records:
        assert (record.contacts.robot_on_wall, record.contacts.robot_on_person) == (0, 0)


def test_decisions_follow_each_other_without_a_gap_and_lead_to_neighbours(demonstrations):
    grid, records = demonstrations
    for record in records:
        decisions = record.decisions
        ended_s = decisions.time_s + decisions.dwell_s
        np.testing.assert_allclose(decisions.time_s[1:], ended_s[:-1], atol=LEAST_DWELL_S)
        assert np.array_equal(decisions.state[1:], decisions.next_state[:-1])
        near = grid.neighbours[decisions.state] == decisions.next_state[:, None]
        assert near.any(axis=1).all()
        assert not decisions.censored.any()


def test_a_move_lasts_at_most_the_patience_and_a_wait_its_own_length(demonstrations):
    for record in demonstrations[1]:
        decisions = record.decisions
        longest_s = np.where(decisions.action == Action.WAIT, HALLWAY.wait_s, HALLWAY.patience_s)
        assert np.all(decisions.dwell_s <= longest_s + HALLWAY.control_period_s)
        waited = (decisions.action == Action.WAIT) & (decisions.state == decisions.next_state)
        # A wait begins between two observations and ends at one.
        late_s = decisions.dwell_s[waited] - HALLWAY.wait_s
        assert np.all((late_s > -1e-6) & (late_s < HALLWAY.control_period_s))


def test_most_moves_succeed_and_the_expert_seldom_stands(demonstrations):
    grid, records = demonstrations
    moved = forward = 0
    standing_s = driven_s = 0.0
    for record in records:
        decisions = record.decisions
        move = decisions.action != Action.WAIT
        intended = grid.neighbours[decisions.state, decisions.action]
        moved += move.sum()
        forward += (move & (intended == decisions.next_state)).sum()
        standing_s += decisions.dwell_s[~move].sum()
        driven_s += record.duration_s
    assert forward / moved > 0.9
    assert 0 < standing_s / driven_s < 0.2


def drive(scenario, driver, *, episode=0, seed=11):
    with HallwayWorld(scenario, seed=seed) as world:
        return run_episode(world, make_planner("dwa", scenario), driver, episode=episode)


def with_patience(scenario, factor):
    return scenario.model_copy(update={"patience_s": factor * scenario.patience_s})


def track(record):
    """What was done and when, to the last bit."""
    decisions = record.decisions
    columns = decisions.time_s, decisions.state, decisions.action, decisions.dwell_s
    return record.duration_s, record.distance_m, np.array(columns).tolist()


@pytest.mark.parametrize("episode", range(2))
def test_where_nobody_is_blocked_a_drive_does_not_depend_on_patience(episode):
    empty = HALLWAY.with_pedestrian_count(0)
    records = [
        drive(with_patience(empty, factor), ScriptedExpert(HALLWAY, 11), episode=episode)
        for factor in (0.5, 1.0, 2.0)
    ]
    assert records[0].outcome == "arrived"
    assert records[0].decisions.dwell_s.max() < 0.5 * HALLWAY.patience_s
    assert track(records[0]) == track(records[1]) == track(records[2])


def test_among_people_arrivals_do_not_depend_on_patience():
    def arrivals_s(factor):
        scenario = with_patience(HALLWAY, factor)
        driver = make_driver("expert_with_flow", scenario, 11)
        return [drive(scenario, driver, episode=each).duration_s for each in range(3)]

    usual = arrivals_s(1.0)
    for factor in (0.5, 2.0):
        difference_s = np.array(arrivals_s(factor)) - usual
        assert abs(np.median(difference_s)) < 0.5
        assert abs(difference_s.mean()) < 0.1 * np.mean(usual)


def test_a_robot_drives_on_over_the_borders_of_cells():
    empty = HALLWAY.with_pedestrian_count(0)
    record = drive(empty, make_driver("expert_with_flow", empty, 11))
    cruising_mps = record.distance_m / record.duration_s
    assert cruising_mps > 0.85 * HALLWAY.robot.max_vel_x_mps


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
    with HallwayWorld(kinematic, seed=2) as world:
        probabilities = np.tile([1.0, 0, 0, 0, 0], (world.grid.n_states, 1))
        record = run_episode(
            world,
            make_planner("dwa", HALLWAY),
            PolicyDriver(world.grid, probabilities),
            episode=0,
            timeout_s=9.5,
        )
    assert record.outcome == "timeout"
    assert np.isnan(record.time_of_arrival_s)
    assert record.n_ticks == 190
    assert record.distance_m < 1e-6
    assert record.decisions.censored.tolist() == [False] * 9 + [True]
    np.testing.assert_allclose(record.decisions.dwell_s, [1.0] * 9 + [0.5])


def test_an_observer_may_abort_and_sees_every_tick():
    seen = []

    def observer(observation, _command, _action):
        seen.append(observation.tick)
        return len(seen) < 30

    with HallwayWorld(HALLWAY, seed=2) as world:
        record = run_episode(
            world,
            make_planner("dwa", HALLWAY),
            ScriptedExpert(HALLWAY, 2),
            episode=0,
            observer=observer,
        )
    assert record.outcome == "aborted"
    assert seen == list(range(30))


class Mine:
    """A planner and a driver that give what neither may give."""

    name, is_blocked = "mine", False

    def __init__(self, wrong):
        self.wrong = wrong

    def reset(self):
        pass

    def begin(self, episode):
        pass

    def step(self, _observation, _waypoint):
        return self.wrong

    def decide(self, _observation, _state):
        return self.wrong


@pytest.mark.parametrize("wrong", [None, (0.1, 0.0), 5, math.nan])
def test_a_planner_without_a_command_and_a_driver_without_an_action_are_named(wrong):
    planner, driver = make_planner("dwa", HALLWAY), ScriptedExpert(HALLWAY, 2)
    with HallwayWorld(HALLWAY, seed=2) as world:
        with pytest.raises(SimError, match=r"step of Mine must return a Command, .* return STOP"):
            run_episode(world, Mine(wrong), driver, episode=0)
        with pytest.raises(SimError, match=r"decide of Mine must return an Action, one of 0 \(WAI"):
            run_episode(world, planner, Mine(wrong), episode=0)


@pytest.mark.parametrize("name", builtin_scenarios())
@pytest.mark.parametrize("start_area", ["train", "transfer"])
def test_the_expert_arrives_in_every_built_in_scenario_from_every_start(name, start_area):
    scenario = load_scenario(name)
    with HallwayWorld(scenario, seed=5) as world:
        record = run_episode(
            world,
            make_planner("dwa", scenario),
            ScriptedExpert(scenario, 5),
            episode=0,
            start_area=start_area,
        )
    assert record.outcome == "arrived"
    assert record.contacts.robot_on_wall == 0
