"""The world with rigid bodies: one seed one trajectory, and who ran into whom."""

import numpy as np
import pytest

from serd_sim.errors import SimError
from serd_sim.robot.bullet import near_people, pybullet
from serd_sim.robot.robot import standing_at
from serd_sim.world.command import Command
from serd_sim.world.world import HallwayWorld
from support.wheeled_robots import physical


def blind(people, **robot):
    """A hallway whose people do not see the robot, and walk into it."""
    return physical(people=people, **robot).with_values("pedestrians", robot_visible=False)


@pytest.mark.parametrize("place_m", [(3.0, 8.0, 0.3), (5.6, 8.0, 0.0)])
def test_a_drive_among_people_who_bump_into_the_robot_repeats_bit_for_bit(place_m):
    with HallwayWorld(blind(40), seed=7) as world:
        drives = []
        for _ in range(2):
            world.reset(0)
            world._robot.place(standing_at(place_m))
            seen = [world.step(Command(0.6, 0.3)) for _ in range(100)]
            poses = [(each.pose, each.people_position_m.tobytes()) for each in seen]
            drives.append((poses, world.contacts, world.minimum_person_distance_m))
    assert drives[0] == drives[1]
    assert world.contacts.person_on_robot + world.contacts.robot_on_person > 0
    assert world.minimum_person_distance_m > -0.03


def test_a_robot_driven_at_a_wall_stays_out_of_it_and_the_contact_counts_once():
    with HallwayWorld(physical(), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((5.0, 8.0, 0.0)))
        for _ in range(60):
            seen = world.step(Command(1.0, 0.0))
    assert seen.x_m == pytest.approx(5.75, abs=0.01)
    assert world.contacts.robot_on_wall == 1


def meeting(robot_mps, person_mps, **robot):
    """(contacts, robot's x, person's x): the robot begins at x = 2 m and a person at x = 3 m."""
    with HallwayWorld(blind(1, **robot), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((2.0, 8.0, 0.0)))
        crowd = world._crowd
        crowd.x_m[0], crowd.y_m[0] = 3.0, 8.0
        places = []
        for _ in range(30):
            if not any(vars(world.contacts).values()):
                crowd.velocity_x_mps[0], crowd.velocity_y_mps[0] = person_mps, 0.0
                crowd.desired_speed_mps[0] = abs(person_mps) + 1e-9
            seen = world.step(Command(robot_mps, 0.0))
            places.append((seen.x_m, float(crowd.x_m[0])))
        return world.contacts, np.array(places)


@pytest.mark.parametrize(
    ("robot_mps", "person_mps", "radius_m"), [(0.8, 0.0, 0.25), (0.8, 0.0, 0.4), (0.0, -1.0, 0.25)]
)
def test_a_contact_is_of_the_one_who_moves_and_pushes_the_other(robot_mps, person_mps, radius_m):
    """The body of the robot may be smaller than the radius of the scenario."""
    contacts, places = meeting(robot_mps, person_mps, radius_m=radius_m)
    counts = contacts.robot_on_person, contacts.person_on_robot
    assert [count > 0 for count in counts] == [robot_mps > 0, person_mps < 0]
    assert places[-1, 1] > 3.0 if robot_mps else places[-1, 0] < 1.99
    assert 0.45 < np.diff(places).min() < 0.52


def test_people_within_reach_of_a_longer_control_period_are_near():
    people = np.array([[0.7, 0.0], [1.6, 0.0], [1.9, 0.0]])
    near = [near_people(people[:, 0], 0.5, each, people, 0.0 * people) for each in (0.05, 0.2)]
    assert [sorted(each) for each in near] == [[0], [0, 1]]


def test_a_world_that_cannot_be_made_leaves_pybullet():
    def connected():
        return [pybullet.getConnectionInfo(client)["isConnected"] for client in range(50)]

    before = connected()
    with pytest.raises(SimError, match="must cover the robot"):
        HallwayWorld(physical(radius_m=0.2), seed=1)
    assert connected() == before
