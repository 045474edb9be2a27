"""The world with rigid bodies: one seed one trajectory, snapshots, contacts with impulses."""

import pickle

import numpy as np
import pytest

from serd_sim.errors import SimError
from serd_sim.robot.bullet import pybullet
from serd_sim.robot.people_bodies import near_people
from serd_sim.robot.robot import standing_at
from serd_sim.world.command import Command
from serd_sim.world.world import HallwayWorld
from support.wheeled_robots import physical

CROWDED = physical(people=40)


def blind(scenario):
    """People who do not see the robot, and walk into it."""
    people = scenario.pedestrians.model_copy(update={"robot_visible": False})
    return scenario.model_copy(update={"pedestrians": people})


def follow(world, n_steps=50):
    seen = [world.step(Command(0.8, 0.3)) for _ in range(n_steps)]
    return (
        [(each.pose, each.speed_mps, each.people_position_m.tobytes()) for each in seen],
        world.contacts,
        world.contact_events,
        world.odometry_pose,
    )


@pytest.mark.parametrize("place_m", [(3.0, 8.0, 0.3), (5.6, 8.0, 0.0)])
def test_a_restored_snapshot_repeats_what_followed_bit_for_bit_even_in_contact(place_m):
    scenario = blind(CROWDED)
    with HallwayWorld(scenario, seed=7) as world, HallwayWorld(scenario, seed=7) as other:
        world.reset(0)
        world._robot.place(standing_at(place_m))
        while not world.contact_events:
            world.step(Command(0.6, 0.0))
        state = pickle.loads(pickle.dumps(world.snapshot()))  # noqa: S301 (made right here)
        first = follow(world)
        world.restore(state)
        assert follow(world) == first
        other.restore(state)
        assert follow(other) == first


def test_a_robot_driven_at_a_wall_stays_out_of_it_and_the_contact_counts_once():
    with HallwayWorld(physical(), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((5.0, 8.0, 0.0)))
        for _ in range(60):
            seen = world.step(Command(1.0, 0.0))
        (event,) = world.contact_events
    assert seen.x_m == pytest.approx(5.75, abs=0.01)
    assert (world.contacts.robot_on_wall, event.kind) == (1, "robot_on_wall")
    assert event.closing_mps == pytest.approx(1.0, abs=0.05)
    assert 0.5 * 18.0 < event.impulse_ns < 1.5 * 18.0


def meeting(robot_command, person_mps, **robot):
    """(contacts, events, robot's x, person's x): the robot at x = 2 and a person at x = 3."""
    with HallwayWorld(blind(physical(people=1, **robot)), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((2.0, 8.0, 0.0)))
        crowd = world._crowd
        crowd.x_m[0], crowd.y_m[0] = 3.0, 8.0
        places = []
        for _ in range(30):
            if not world.contact_events:
                crowd.velocity_x_mps[0], crowd.velocity_y_mps[0] = person_mps, 0.0
                crowd.desired_speed_mps[0] = abs(person_mps) + 1e-9
            seen = world.step(robot_command)
            places.append((seen.x_m, float(crowd.x_m[0])))
        return world.contacts, world.contact_events, np.array(places)


@pytest.mark.parametrize(("robot_mps", "person_mps"), [(0.8, 0.0), (0.0, -1.0)])
def test_a_contact_is_of_the_one_who_moves_and_pushes_the_other(robot_mps, person_mps):
    """A person weighs four times as much as the robot: at most m M / (m + M) times the speed."""
    contacts, events, places = meeting(Command(robot_mps, 0.0), person_mps)
    counts = contacts.robot_on_person, contacts.person_on_robot
    assert [count > 0 for count in counts] == [robot_mps > 0, person_mps < 0]
    assert events[0].person == 0
    closing_mps = robot_mps - person_mps
    assert 0.7 * closing_mps < events[0].closing_mps <= closing_mps + 0.1
    assert 0.3 * 14.5 * closing_mps < events[0].impulse_ns < 3.0 * 14.5 * closing_mps
    assert places[-1, 1] > 3.0 if robot_mps else places[-1, 0] < 1.99


def test_a_body_smaller_than_the_radius_touches_and_pushes():
    contacts, events, places = meeting(Command(0.8, 0.0), 0.0, radius_m=0.4)
    assert contacts.robot_on_person == 1
    assert events[0].closing_mps == pytest.approx(0.8, abs=0.1)
    usual = meeting(Command(0.8, 0.0), 0.0)[2]
    assert np.diff(places).min() == pytest.approx(np.diff(usual).min(), abs=0.02)
    assert usual[-1, 1] > 3.0


def test_people_within_reach_of_a_longer_control_period_are_near():
    people = np.array([[0.7, 0.0], [1.6, 0.0], [1.9, 0.0]])
    near = [near_people(people[:, 0], 0.5, each, people, 0.0 * people) for each in (0.05, 0.2)]
    assert [sorted(each) for each in near] == [[0], [0, 1]]


def test_a_world_that_cannot_be_made_leaves_pybullet(monkeypatch):
    def connected():
        return [pybullet.getConnectionInfo(client)["isConnected"] for client in range(50)]

    monkeypatch.delenv("DISPLAY", raising=False)
    before = connected()
    for robot, sentence in (({"radius_m": 0.2}, "must cover the robot"), ({}, "gui must be off")):
        with pytest.raises(SimError, match=sentence):
            HallwayWorld(physical(**robot), seed=1, gui=True)
    assert connected() == before
