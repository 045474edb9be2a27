"""The physical drive against closed forms of rigid bodies and differential drives."""

import math

import numpy as np
import pytest

from serd_sim.errors import SimError
from serd_sim.robot.bullet import PERSON_MASS_KG, near_people, pybullet
from serd_sim.robot.physical_robot import PhysicalRobot
from serd_sim.world.command import STOP, Command
from serd_sim.world.world import HallwayWorld
from support.wheeled_robots import physical

STEP_S = 0.05
MASS_KG, WHEEL_RADIUS_M = 18.0, 0.08
#: With the inertia of the wheels.
ROLLING_KG = MASS_KG + 2.0 * 0.0026 / WHEEL_RADIUS_M**2


def started(world, x_m=3.0, y_m=8.0, yaw_rad=0.0):
    """Put the robot of the world somewhere, where its odometry has it too; its pose then."""
    world.reset(0)
    world._robot.place((x_m, y_m, yaw_rad))
    world._odometry.pose = world._robot.state.pose
    return world._robot.state.pose


def driven(world, command, n_steps):
    """(n, 5): x, y, yaw, speed, yaw rate after each control period."""
    rows = []
    for _ in range(n_steps):
        seen = world.step(command)
        rows.append((*world._robot.state.pose, seen.speed_mps, seen.yaw_rate_radps))
    return np.array(rows)


def test_constant_speeds_drive_a_straight_line_or_a_circle():
    """Its radius is v / w, and it closes after 2 pi / w."""
    with HallwayWorld(physical(), seed=1) as world:
        started(world, 2.0, 4.0, 0.8)
        (*first, _, _), *_, (*last, speed, _) = driven(world, Command(0.6, 0.0), 71)[10:]
        started(world)
        path = driven(world, Command(0.5, -1.0), 146)[20:]
    assert math.dist(first[:2], last[:2]) == pytest.approx(0.6 * 60 * STEP_S, rel=2e-3)
    assert last[2] == pytest.approx(first[2], abs=2e-3)
    assert speed == pytest.approx(0.6, rel=2e-3)
    radii = np.hypot(*(path[:, :2] - path[:-1, :2].mean(axis=0)).T)
    assert radii == pytest.approx(np.full(126, 0.5), rel=0.01)
    assert path[60:, 4].mean() == pytest.approx(-1.0, rel=3e-3)


def test_the_step_response_is_a_ramp_at_the_acceleration_of_the_limit_or_of_the_torque():
    """2 T / r = (m + 2 I / r^2) a."""
    speeds, torque_nm = [], 0.8
    for scenario in (physical(), physical(wheel_torque_nm=torque_nm)):
        with HallwayWorld(scenario, seed=1) as world:
            started(world)
            speeds.append(driven(world, Command(0.6, 0.0), 12)[:, 3])
    assert speeds[0] == pytest.approx(np.minimum(2.5 * STEP_S * np.arange(1, 13), 0.6), abs=0.025)
    expected = 2.0 * torque_nm / WHEEL_RADIUS_M / ROLLING_KG
    assert np.diff(speeds[1])[2:9] / STEP_S == pytest.approx(np.full(7, expected), rel=0.02)


def test_friction_limits_the_deceleration():
    """Braking shifts weight from the wheels, 9 mm ahead of the centre of mass, to the caster.

    With its height h and distances w of the wheels and c of the front caster, the wheels' load is
    N = m g / (1 + (mu h - w) / c) and the deceleration mu N / m.
    """
    strong = physical(decel_lim_x_mps2=1000.0, wheel_torque_nm=100.0)
    with HallwayWorld(strong, seed=1) as world:
        started(world, 2.0, 4.0, math.pi / 2)
        driven(world, Command(1.2, 0.0), 30)
        speed = driven(world, STOP, 4)[:, 3]
    height_m = (16.0 * 0.1 + 1.6 * 0.08 + 0.4 * 0.031) / MASS_KG
    behind_m = 16.0 * 0.01 / MASS_KG
    load = 9.81 / (1.0 + (0.8 * height_m - behind_m) / (0.2 + behind_m))
    assert -np.diff(speed)[:2].mean() / STEP_S == pytest.approx(0.8 * load, rel=0.05)


def test_odometry_of_equal_wheels_follows_the_truth_until_they_slip():
    with HallwayWorld(physical(), seed=1) as world:
        started(world, 3.0, 3.0, math.pi / 2)
        driven(world, Command(0.8, 0.0), 100)
        assert math.dist(world.odometry_pose[:2], world.observation.pose[:2]) < 0.02
        started(world, 5.7)
        driven(world, Command(0.8, 0.0), 100)
        assert world.observation.x_m < 5.78
        assert world.odometry_pose[0] > 7.5


def test_a_walking_person_pushes_a_freely_rolling_robot_with_conserved_momentum():
    """m v = m u + M w with the inertia of the wheels in M; both move on at about one speed.

    The robot is hit above its centre of mass and rocks on its casters, so w is not quite u.
    """
    robot = PhysicalRobot(physical(people=1, wheel_torque_nm=1e-9), 0.25)
    robot.place((3.0, 8.0, 0.0))
    assert robot.roll((0.0, 0.0), {0: ((2.48, 8.0), (1.0, 0.0))}) == ({0}, False)
    robot._observe((0.0, 0.0))
    (_, (person_mps, sideways_mps)), motion = robot.people.motion(0), robot.state
    robot.close()
    momentum = PERSON_MASS_KG * person_mps + ROLLING_KG * motion.velocity_mps[0]
    assert momentum == pytest.approx(PERSON_MASS_KG * 1.0, rel=0.01)
    common_mps = PERSON_MASS_KG / (PERSON_MASS_KG + ROLLING_KG)
    assert (motion.velocity_mps[0], person_mps) == pytest.approx((common_mps,) * 2, rel=0.1)
    assert sideways_mps == pytest.approx(0.0, abs=0.01)


def blind(people, **robot):
    """A hallway whose people do not see the robot, and walk into it."""
    return physical(people=people, **robot).with_values("pedestrians", robot_visible=False)


@pytest.mark.parametrize("place_m", [(3.0, 8.0, 0.3), (5.6, 8.0, 0.0)])
def test_a_drive_among_people_who_bump_into_the_robot_repeats_bit_for_bit(place_m):
    with HallwayWorld(blind(40), seed=7) as world:
        drives = []
        for _ in range(2):
            world.reset(0)
            world._robot.place(place_m)
            seen = [world.step(Command(0.6, 0.3)) for _ in range(100)]
            poses = [(each.pose, each.people_position_m.tobytes()) for each in seen]
            drives.append((poses, world.contacts, world.minimum_person_distance_m))
    assert drives[0] == drives[1]
    assert world.contacts.person_on_robot + world.contacts.robot_on_person > 0
    assert world.minimum_person_distance_m > -0.03


def test_a_robot_driven_at_a_wall_stays_out_of_it_and_the_contact_counts_once():
    with HallwayWorld(physical(), seed=1) as world:
        started(world, 5.0)
        path = driven(world, Command(1.0, 0.0), 60)
    assert path[-1, 0] == pytest.approx(5.75, abs=0.01)
    assert world.contacts.robot_on_wall == 1


def meeting(robot_mps, person_mps, **robot):
    """(contacts, robot's x, person's x): the robot begins at x = 2 m and a person at x = 3 m."""
    with HallwayWorld(blind(1, **robot), seed=1) as world:
        started(world, 2.0)
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
