"""Movable obstacles against closed forms of sliding, turning and pushed bodies."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from sim.pictures.scene import Scene
from sim.pictures.top_view import TopView
from sim.robot import movable_bodies
from sim.robot.dynamics import Dynamics
from sim.robot.people_bodies import PERSON_MASS_KG
from sim.robot.robot import standing_at
from sim.robot.sensors.lidar import Lidar
from sim.world.command import STOP, Command
from sim.world.world import HallwayWorld
from support.movable_obstacles import CHAIR, DOOR, room

SUBSTEP_S, STEP_S = 0.005, 0.05
HOLD = (0.0, 0.0)
CHAIR_KG, CHAIR_M, DOOR_KG = 5.0, 0.4, 20.0
ROBOT_KG = 18.0 + 2.0 * 0.0026 / 0.08**2


@pytest.fixture
def no_friction(monkeypatch):
    monkeypatch.setattr(movable_bodies, "FLOOR_FRICTION", 0.0)
    monkeypatch.setattr(movable_bodies, "HINGE_TORQUE_NM", 0.0)


def dynamics_of(scenario, start=(2.0, 2.0, 0.0), speed_mps=0.0):
    dynamics = Dynamics(scenario, 0.25)
    dynamics.place(replace(standing_at(start), speed_mps=speed_mps))
    return dynamics


def set_moving(dynamics, *speeds):
    body = dynamics.obstacles._bodies[0]
    for joint, speed in enumerate(speeds):
        dynamics._client.resetJointState(body, joint, 0.0, speed)


@pytest.mark.parametrize("heading_rad", [0.0, 0.4, math.pi / 4, 2.0])
def test_a_sliding_body_stops_after_v2_over_2_mu_g_in_every_direction(heading_rad):
    """Less half of what it slides in a substep, after which friction begins to act."""
    dynamics = dynamics_of(room(CHAIR))
    set_moving(dynamics, math.cos(heading_rad), math.sin(heading_rad), 0.0)
    for _ in range(10):
        dynamics.drive(HOLD, {})
    (x_m, y_m, yaw_rad), (motion,) = dynamics.obstacles.poses[0], dynamics.obstacles.motions
    dynamics.close()
    expected_m = 1.0 / (2.0 * 0.4 * 9.81) - 0.5 * SUBSTEP_S
    assert (x_m - 5.2, y_m - 5.2) == pytest.approx(
        (expected_m * math.cos(heading_rad), expected_m * math.sin(heading_rad)), rel=2e-3, abs=1e-6
    )
    assert yaw_rad == pytest.approx(0.0, abs=1e-9)
    assert motion == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_turning_body_stops_after_w2_over_2_mu_g_over_its_radius_of_gyration():
    dynamics = dynamics_of(room(CHAIR))
    set_moving(dynamics, 0.0, 0.0, 5.0)
    for _ in range(10):
        dynamics.drive(HOLD, {})
    yaw_rad = dynamics.obstacles.poses[0][2]
    dynamics.close()
    gyration_m = CHAIR_M / math.sqrt(6.0)
    expected_rad = 25.0 * gyration_m / (2.0 * 0.4 * 9.81) - 5.0 * 0.5 * SUBSTEP_S
    assert yaw_rad == pytest.approx(expected_rad, rel=2e-3)


@pytest.mark.usefixtures("no_friction")
def test_a_rolling_robot_and_a_chair_conserve_momentum():
    dynamics = dynamics_of(room(CHAIR, wheel_torque_nm=1e-9), (4.72, 5.2, 0.0), 0.8)
    impulses = dynamics.drive((10.0, 10.0), {}, near_walls=True)
    (vx_mps, _), ((chair_mps, sideways_mps, _),) = (
        dynamics.state().velocity_mps,
        dynamics.obstacles.motions,
    )
    dynamics.close()
    assert ROBOT_KG * vx_mps + CHAIR_KG * chair_mps == pytest.approx(ROBOT_KG * 0.8, rel=0.01)
    assert impulses.obstacles[0].impulse_ns == pytest.approx(CHAIR_KG * chair_mps, rel=0.01)
    assert impulses.obstacles[0].place_m == pytest.approx((0.25, 0.0), abs=0.005)
    assert chair_mps >= ROBOT_KG * 0.8 / (ROBOT_KG + CHAIR_KG) - 0.01
    assert sideways_mps == pytest.approx(0.0, abs=0.01)


@pytest.mark.usefixtures("no_friction")
def test_a_person_and_a_chair_conserve_momentum():
    dynamics = dynamics_of(room(CHAIR, people=[(4.0, 4.0)]))
    dynamics.drive(HOLD, {0: ((4.72, 5.2), (1.0, 0.0))})
    (_, (person_mps, _)), ((chair_mps, _, _),) = (
        dynamics.people.motion(0),
        dynamics.obstacles.motions,
    )
    dynamics.close()
    momentum = PERSON_MASS_KG * person_mps + CHAIR_KG * chair_mps
    assert momentum == pytest.approx(PERSON_MASS_KG, rel=1e-3)
    assert person_mps == pytest.approx(PERSON_MASS_KG / (PERSON_MASS_KG + CHAIR_KG), rel=0.01)


@pytest.mark.usefixtures("no_friction")
def test_a_person_who_opens_a_door_conserves_angular_momentum_about_the_hinge():
    """The leaf is a rod of length l and thickness d with m (l^2 + d^2) / 12 about its middle."""
    arm_m = 0.8
    dynamics = dynamics_of(room(DOOR, people=[(4.0, 4.0)]))
    dynamics.drive(HOLD, {0: ((4.72, 5.0 + arm_m), (1.0, 0.0))})
    (place_m, (vx_mps, vy_mps)), ((_, _, yaw_rate),) = (
        dynamics.people.motion(0),
        dynamics.obstacles.motions,
    )
    dynamics.close()
    inertia = DOOR_KG * ((1.0 + 0.05**2) / 12.0 + 0.25)
    along_m, across_m = place_m[0] - 5.025, place_m[1] - 5.0
    after = PERSON_MASS_KG * (along_m * vy_mps - across_m * vx_mps) + inertia * yaw_rate
    assert yaw_rate < -0.5
    assert after == pytest.approx(-PERSON_MASS_KG * arm_m, rel=0.01)


def test_a_door_opens_by_a_quarter_at_most():
    dynamics = dynamics_of(room(DOOR))
    set_moving(dynamics, 6.0)
    for _ in range(40):
        dynamics.drive(HOLD, {})
    assert dynamics.obstacles.poses[0] == (5.025, 5.0, pytest.approx(math.pi / 2, abs=0.04))
    dynamics.close()


def driven(world, place, command, n_steps):
    world.reset(0)
    world._robot.place(standing_at(place))
    for _ in range(n_steps):
        world.step(command)


def test_the_robot_pushes_a_chair_which_is_one_contact_at_the_front_of_its_hull():
    with HallwayWorld(room(CHAIR), seed=1) as world:
        driven(world, (4.2, 5.2, 0.0), Command(0.6, 0.0), 60)
        (event,) = world.contact_events
        ((x_m, _, _),) = world.obstacle_poses
        assert x_m == pytest.approx(world.observation.x_m + 0.25 + 0.5 * CHAIR_M, abs=0.01)
    assert world.contacts.robot_on_wall == 1
    assert event.kind == "robot_on_wall"
    assert event.closing_mps == pytest.approx(0.6, abs=0.02)
    assert event.place_m == pytest.approx((0.25, 0.0), abs=0.005)


def walked_into(obstacle, start_m, speed_mps):
    """(the obstacle's pose, the person's way) after a person has walked east for 3 s."""
    with HallwayWorld(room(obstacle, people=[(9.5, start_m[1])]), seed=1) as world:
        world.reset(0)
        crowd = world._crowd
        crowd.move(0, start_m, (speed_mps, 0.0))
        crowd.desired_speed_mps[0] = 1.2
        way = []
        for _ in range(60):
            world.step(STOP)
            way.append((float(crowd.x_m[0]), float(crowd.y_m[0])))
        return world.obstacle_poses[0], np.array(way)


def test_a_walking_person_opens_a_door():
    (_, _, angle_rad), way = walked_into(DOOR, (4.0, 5.6), 0.0)
    assert angle_rad < -0.5
    assert way[-1, 0] > 5.5


def test_people_stop_before_a_chair_as_before_a_wall():
    (x_m, _, _), way = walked_into(CHAIR, (4.0, 5.2), 0.0)
    assert x_m == pytest.approx(5.2)
    assert 4.5 < way[:, 0].max() < 4.75


def test_a_person_who_cannot_stop_pushes_the_chair():
    (x_m, _, _), way = walked_into(CHAIR, (4.6, 5.2), 1.5)
    assert x_m > 5.23
    assert (way[:, 0] < x_m - 0.5 * CHAIR_M - 0.2).all()


def test_the_lidar_sees_a_moved_and_turned_chair_as_rays_of_bullet_do():
    scenario = room(CHAIR)
    with HallwayWorld(scenario, seed=1) as world:
        driven(world, (4.2, 5.1, 0.0), Command(0.6, 0.2), 60)
        (pose,) = world.obstacle_poses
        assert abs(pose[2]) > 0.05
        x_m, y_m, _ = seen = (4.0, 4.5, 0.0)
        dynamics, lidar = (
            world._robot._dynamics,
            Lidar(scenario.lidar, scenario.wall_segments_m, 0.25),
        )
        ranges = lidar.scan(
            seen, np.zeros(0), np.zeros(0), obstacles_m=world._robot.obstacle_segments_m
        )
        angles = lidar.angles_rad
        ends = [(x_m + 9.0 * math.cos(a), y_m + 9.0 * math.sin(a), 0.4) for a in angles]
        hits = dynamics._client.rayTestBatch([(x_m, y_m, 0.4)] * len(ends), ends)
        chair = dynamics.obstacles._bodies[0]
        expected = {index: 9.0 * hit[2] for index, hit in enumerate(hits) if hit[0] == chair}
    assert len(expected) > 5
    for index, range_m in expected.items():
        if index - 1 in expected and index + 1 in expected:
            assert ranges[index] == pytest.approx(range_m, abs=0.005)


def follow(world, n_steps=40):
    seen = [world.step(Command(0.6, 0.2)) for _ in range(n_steps)]
    poses = [each.pose for each in seen]
    return poses, world.obstacle_poses, world.contact_events, world.scan().tobytes()


def test_a_snapshot_during_a_push_repeats_what_followed_bit_for_bit():
    door = {**DOOR, "outline_m": [[7, 5], [7.05, 5], [7.05, 6], [7, 6]], "hinge_m": [7.025, 5]}
    scenario = room(CHAIR, door, people=[(6.0, 5.2)])
    with HallwayWorld(scenario, seed=7) as world, HallwayWorld(scenario, seed=7) as other:
        driven(world, (4.2, 5.2, 0.0), Command(0.6, 0.0), 40)
        assert world.contact_events
        state = pickle.loads(pickle.dumps(world.snapshot()))  # noqa: S301 (made right here)
        first = follow(world)
        world.restore(state)
        assert follow(world) == first
        other.restore(state)
        assert follow(other) == first
        world.reset(3)
        other.reset(3)
        assert world.obstacle_poses == tuple(each.pose for each in scenario.movable_obstacles)
        assert follow(world) == follow(other)


@pytest.mark.parametrize("pose", [(5.2, 5.2, 0.0), (7.0, 3.0, 0.6)])
def test_pictures_show_an_obstacle_where_it_is(pose):
    scenario = room(CHAIR)
    top = TopView(scenario, pixels_per_m=20.0)
    changed = (top.frame(obstacle_poses=[pose]) != top.frame()).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert (columns.mean() / 20 - 0.3, 10.3 - rows.mean() / 20) == pytest.approx(pose[:2], abs=0.05)
    assert changed.sum() / 400 == pytest.approx(CHAIR_M**2, rel=0.1)
    scene = Scene(scenario)
    scene.place_obstacles([pose])
    place_m, turn = scene.client.getBasePositionAndOrientation(scene._obstacles[0])
    scene.close()
    assert (*place_m[:2], 2.0 * math.atan2(turn[2], turn[3])) == pytest.approx(pose)


def test_the_picture_of_the_world_follows_the_chair():
    with HallwayWorld(room(CHAIR), seed=1) as world:
        world.reset(0)
        before = world.picture()
        driven(world, (4.2, 5.2, 0.0), Command(0.6, 0.0), 60)
        driven_x_m = world.obstacle_poses[0][0]
        scene = world._pictures
        world.picture()
        place_m, _ = scene.client.getBasePositionAndOrientation(scene._obstacles[0])
    assert place_m[0] == pytest.approx(driven_x_m)
    assert before.shape[2] == 3
