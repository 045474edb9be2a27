"""The physical drive against closed forms of rigid bodies and differential drives."""

import math

import numpy as np
import pytest

from serd_sim.robot.dynamics import Dynamics
from serd_sim.robot.people_bodies import PERSON_MASS_KG
from serd_sim.robot.robot import standing_at
from serd_sim.world.command import STOP, Command
from serd_sim.world.world import HallwayWorld
from support.wheeled_robots import physical, urdf_with

STEP_S = 0.05
HOLD = (0.0, 0.0)
MASS_KG, WHEEL_RADIUS_M, WHEEL_INERTIA_KGM2 = 18.0, 0.08, 0.0026


def started(world, x_m=3.0, y_m=8.0, yaw_rad=0.0):
    """The world with its robot put somewhere; the pose that it then has."""
    world.reset(0)
    world._robot.place(standing_at((x_m, y_m, yaw_rad)))
    return world._robot.state.pose


def driven(world, command, n_steps):
    """(n, 5): x, y, yaw, speed, yaw rate after each control period."""
    rows = []
    for _ in range(n_steps):
        seen = world.step(command)
        rows.append((*world._robot.state.pose, seen.speed_mps, seen.yaw_rate_radps))
    return np.array(rows)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.8, math.pi / 2])
def test_a_constant_speed_drives_a_straight_line(yaw_rad):
    with HallwayWorld(physical(), seed=1) as world:
        started(world, 2.0, 4.0, yaw_rad)
        driven(world, Command(0.6, 0.0), 10)
        (*first, _, _), *_, (*last, speed, _) = driven(world, Command(0.6, 0.0), 61)
    assert math.dist(first[:2], last[:2]) == pytest.approx(0.6 * 60 * STEP_S, rel=2e-3)
    assert last[2] == pytest.approx(first[2], abs=2e-3)
    assert speed == pytest.approx(0.6, rel=2e-3)


@pytest.mark.parametrize("turn_radps", [1.0, -1.0])
def test_constant_speeds_drive_a_circle(turn_radps):
    """Its radius is v / w, and it closes after 2 pi / w."""
    with HallwayWorld(physical(), seed=1) as world:
        started(world)
        driven(world, Command(0.5, turn_radps), 20)
        path = driven(world, Command(0.5, turn_radps), 126)
    middle = path[:-1, :2].mean(axis=0)
    radii = np.hypot(*(path[:, :2] - middle).T)
    assert radii == pytest.approx(np.full(126, 0.5), rel=0.01)
    assert path[60:, 4].mean() == pytest.approx(turn_radps, rel=3e-3)


def test_the_step_response_is_a_ramp_at_the_largest_acceleration():
    with HallwayWorld(physical(), seed=1) as world:
        started(world)
        speed = driven(world, Command(0.6, 0.0), 12)[:, 3]
    time_s = STEP_S * np.arange(1, 13)
    assert speed == pytest.approx(np.minimum(2.5 * time_s, 0.6), abs=0.025)


def test_a_weak_motor_accelerates_as_its_torque_allows():
    """2 T / r = (m + 2 I / r^2) a."""
    torque_nm = 0.8
    with HallwayWorld(physical(wheel_torque_nm=torque_nm), seed=1) as world:
        started(world)
        speed = driven(world, Command(1.2, 0.0), 10)[:, 3]
    moved_kg = MASS_KG + 2.0 * WHEEL_INERTIA_KGM2 / WHEEL_RADIUS_M**2
    expected = 2.0 * torque_nm / WHEEL_RADIUS_M / moved_kg
    assert np.diff(speed)[2:] / STEP_S == pytest.approx(np.full(7, expected), rel=0.02)


@pytest.mark.parametrize("speed_mps", [0.5, 1.0])
def test_the_stopping_distance_is_that_of_the_largest_deceleration(speed_mps):
    """v^2 / 2 a with 4 m/s^2, which the floor allows."""
    with HallwayWorld(physical(decel_lim_x_mps2=4.0), seed=1) as world:
        started(world, 2.0, 4.0, math.pi / 2)
        from_m = driven(world, Command(speed_mps, 0.0), 30)[-1]
        to_m = driven(world, STOP, 20)[-1]
    expected_m = speed_mps**2 / 8.0
    assert math.dist(from_m[:2], to_m[:2]) == pytest.approx(expected_m, rel=0.1)
    assert to_m[3] == pytest.approx(0.0, abs=1e-3)


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


def after_arcs(pose, motions):
    """The pose after arcs of (n, 2) length and angle."""
    x_m, y_m, yaw_rad = pose
    for distance_m, turned_rad in motions:
        x_m += distance_m * math.cos(yaw_rad + turned_rad / 2)
        y_m += distance_m * math.sin(yaw_rad + turned_rad / 2)
        yaw_rad += turned_rad
    return np.array([x_m, y_m])


@pytest.mark.parametrize("turn_radps", [0.9, -0.9])
def test_unequal_wheels_give_the_systematic_error_of_the_umbmark_square(tmp_path, turn_radps):
    """Borenstein & Feng, IEEE Trans. Robotics and Automation 12(6), 1996.

    With radii r (1 -+ e) the odometry's (d, a) is really (d + e a L / 2, a + 2 e d / L).
    """
    error = 0.005
    path = urdf_with(tmp_path)
    text = path.read_text()
    at = text.index('<link name="right_wheel">')
    smaller, larger = (f'<sphere radius="{0.08 * (1 + sign * error)}"/>' for sign in (-1, 1))
    nominal = '<sphere radius="0.08"/>'
    path.write_text(text[:at].replace(nominal, smaller) + text[at:].replace(nominal, larger))
    motions = []
    with HallwayWorld(physical(urdf=str(path), wheel_radius_m=0.08), seed=1) as world:
        start = started(world, 3.0 + math.copysign(1.0, turn_radps), 11.0, math.pi / 2)
        world._odometry.pose = start
        for _ in range(4):
            for command, steps in ((Command(0.5, 0.0), 80), (Command(0.0, turn_radps), 35)):
                for tick in range(steps + 8):
                    world.step(command if tick < steps else STOP)
                    motions.append(world._robot.wheel_motion)
        final, odometry = world._robot.state.pose, world.odometry_pose
    believed = np.array(motions)
    really = believed + error * believed[:, ::-1] * (0.16, 2.0 / 0.32)
    known_m = after_arcs(start, really) - after_arcs(start, believed)
    assert np.hypot(*known_m) > 0.15
    assert np.subtract(final[:2], odometry[:2]) == pytest.approx(
        known_m, abs=0.1 * np.hypot(*known_m)
    )


def test_odometry_of_equal_wheels_follows_the_truth_until_they_slip():
    with HallwayWorld(physical(), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((3.0, 3.0, math.pi / 2)))
        world._odometry.pose = (3.0, 3.0, math.pi / 2)
        for _ in range(100):
            world.step(Command(0.8, 0.0))
        drift_m = math.dist(world.odometry_pose[:2], world.observation.pose[:2])
        world._robot.place(standing_at((5.7, 8.0, 0.0)))
        world._odometry.pose = (5.7, 8.0, 0.0)
        for _ in range(100):
            world.step(Command(0.8, 0.0))
    assert drift_m < 0.02
    assert world.observation.x_m < 5.78
    assert world.odometry_pose[0] > 7.5


def test_a_walking_person_pushes_a_freely_rolling_robot_with_conserved_momentum():
    """m v = m u + M w with the inertia of the wheels in M; both move on at about one speed.

    The robot is hit above its centre of mass and rocks on its casters, so w is not quite u.
    """
    scenario = physical(people=1, wheel_torque_nm=1e-9)
    dynamics = Dynamics(scenario, 0.25)
    dynamics.place(standing_at((3.0, 8.0, 0.0)))
    impulses = dynamics.drive(HOLD, {0: ((2.48, 8.0), (1.0, 0.0))})
    (_, (person_mps, sideways_mps)), motion = dynamics.people.motion(0), dynamics.state()
    dynamics.close()
    robot_kg = MASS_KG + 2.0 * WHEEL_INERTIA_KGM2 / WHEEL_RADIUS_M**2
    momentum = PERSON_MASS_KG * person_mps + robot_kg * motion.velocity_mps[0]
    assert momentum == pytest.approx(PERSON_MASS_KG * 1.0, rel=0.01)
    assert impulses.people_ns[0] == pytest.approx(PERSON_MASS_KG * (1.0 - person_mps), rel=1e-4)
    common_mps = PERSON_MASS_KG / (PERSON_MASS_KG + robot_kg)
    assert motion.velocity_mps[0] == pytest.approx(common_mps, rel=0.1)
    assert person_mps == pytest.approx(common_mps, rel=0.1)
    assert sideways_mps == pytest.approx(0.0, abs=0.01)


def test_a_braked_robot_is_shoved_and_slides_to_rest():
    scenario = physical(people=1)
    dynamics = Dynamics(scenario, 0.25)
    dynamics.place(standing_at((3.0, 8.0, 0.0)))
    dynamics.drive(HOLD, {0: ((3.0, 7.48), (0.0, 1.2))})
    speeds = [dynamics.state().velocity_mps[1]]
    for _ in range(30):
        dynamics.drive(HOLD, {})
        speeds.append(dynamics.state().velocity_mps[1])
    moved_m = dynamics.state().pose[1] - 8.0
    dynamics.close()
    assert max(speeds) > 0.7
    assert speeds[-1] == pytest.approx(0.0, abs=0.01)
    assert 0.05 < moved_m < 0.4
