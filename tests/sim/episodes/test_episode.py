"""Whole episodes: the expert arrives, the world answers sanely, and it all repeats."""

import math

import numpy as np
import pytest

from serd_core.grid.grid import Action
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.drivers.policy_driver import PolicyDriver
from serd_sim.episodes.episode import run_episode
from serd_sim.errors import SimError
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.names import builtin_scenarios
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway")


@pytest.fixture(scope="module")
def demonstrations():
    with HallwayWorld(HALLWAY, seed=1) as world:
        planner, expert = make_planner("dwa", HALLWAY), ScriptedExpert(HALLWAY, 1)
        return world.grid, [
            run_episode(world, planner, expert, episode=episode) for episode in range(10)
        ]


def test_the_expert_arrives_in_nearly_all_episodes_touches_nobody_and_decides_every_two_seconds(
    demonstrations,
):
    grid, records = demonstrations
    arrived = [record for record in records if record.outcome == "arrived"]
    assert len(arrived) >= 9
    assert max(record.time_of_arrival_s for record in arrived) < 120.0
    for record in arrived:
        assert grid.centers_m[record.decisions.next_state[-1]][0] > 11
    for record in records:
        assert (record.contacts.robot_on_wall, record.contacts.robot_on_person) == (0, 0)
        np.testing.assert_allclose(np.diff(record.decisions.time_s), 2.0, atol=1e-9)


def test_most_moves_succeed_and_nearly_all_reach_a_neighbour_or_stay(demonstrations):
    grid, records = demonstrations
    moved = forward = adjacent = 0
    for record in records:
        decisions = record.decisions
        move = decisions.action != Action.WAIT
        intended = grid.neighbours[decisions.state, decisions.action]
        moved += move.sum()
        forward += (move & (intended == decisions.next_state)).sum()
        near = (grid.neighbours[decisions.state] == decisions.next_state[:, None]).any(axis=1)
        adjacent += near.sum() / len(near)
    assert forward / moved > 0.85
    assert adjacent / len(records) > 0.97


def test_a_waiting_policy_times_out_where_it_started():
    kinematic = HALLWAY.with_values("robot", drive="kinematic")  # a body settles on its casters
    with HallwayWorld(kinematic, seed=2) as world:
        probabilities = np.tile([1.0, 0, 0, 0, 0], (world.grid.n_states, 1))
        record = run_episode(
            world,
            make_planner("dwa", HALLWAY),
            PolicyDriver(world.grid, probabilities),
            episode=0,
            timeout_s=10.0,
        )
    assert record.outcome == "timeout"
    assert np.isnan(record.time_of_arrival_s)
    assert record.n_ticks == 200
    assert record.distance_m < 1e-6
    assert len(record.decisions) == 5


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

    def decide(self, _observation):
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
