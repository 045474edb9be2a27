"""IMU and bumper against closed forms, with both drives."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from sim.robot.quaternion import product, rotated
from sim.robot.robot import RobotState, standing_at
from sim.robot.sensors.imu import Imu, Inertial
from sim.scenario.scenario import Scenario, load_scenario
from sim.scenario.settings import ImuSettings
from sim.world.command import STOP, Command
from sim.world.world import HallwayWorld
from support.wheeled_robots import physical

STEP_S, GRAVITY = 0.05, 9.81
SILENT = dict.fromkeys(ImuSettings.model_fields, 0.0)
#: Clearance of a caster over its distance from the axle.
TILT_RAD = 0.001 / 0.2
ROBOT_KG = 18.0 + 2.0 * 0.0026 / 0.08**2


def silent(drive, **robot):
    """The empty hallway with an IMU without noise."""
    scenario = physical(**robot, drive=drive) if robot else physical(drive=drive)
    return Scenario.model_validate(scenario.model_dump() | {"imu": SILENT})


def measured(scenario, *driven):
    """(n, 6) angular velocity and acceleration in the last ticks, after pairs (command, ticks)."""
    with HallwayWorld(scenario, seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((3.0, 8.0, 0.5)))
        readings = []
        for command, n_steps in driven:
            readings = []
            for _ in range(n_steps):
                world.step(command)
                readings.append((*world.imu.angular_velocity_radps, *world.imu.acceleration_mps2))
        return np.array(readings)


@pytest.mark.parametrize(("drive", "tilt_rad"), [("kinematic", 0.0), ("physical", TILT_RAD)])
def test_a_standing_robot_measures_gravity_alone(drive, tilt_rad):
    """It leans back on its rear caster, which is a little above the floor when it is level."""
    readings = measured(silent(drive), (STOP, 12))[2:]
    expected = [0.0, 0.0, 0.0, GRAVITY * math.sin(tilt_rad), 0.0, GRAVITY * math.cos(tilt_rad)]
    assert readings == pytest.approx(np.tile(expected, (10, 1)), abs=3e-3)


@pytest.mark.parametrize(("drive", "tilt_rad"), [("kinematic", 0.0), ("physical", TILT_RAD)])
@pytest.mark.parametrize("turn_radps", [1.0, -1.5])
def test_on_a_circle_the_acceleration_is_centripetal(drive, tilt_rad, turn_radps):
    """v w towards the centre; its mean over a period is v w sin(w h / 2) / (w h / 2)."""
    readings = measured(
        silent(drive), (Command(0.5, turn_radps), 20), (Command(0.5, turn_radps), 40)
    )
    half = 0.5 * turn_radps * STEP_S
    inwards = 0.5 * turn_radps * math.sin(half) / half
    mean = readings.mean(axis=0)
    assert mean[:3] == pytest.approx([0.0, 0.0, turn_radps], abs=0.01)
    assert mean[3:] == pytest.approx([GRAVITY * tilt_rad, inwards, GRAVITY], abs=0.01)


@pytest.mark.parametrize(("drive", "within"), [("kinematic", 1e-9), ("physical", 0.03)])
def test_a_stop_is_measured_as_the_largest_deceleration(drive, within):
    """While the physical robot rocks from one caster to the other, its centre moves on its own."""
    scenario = silent(drive, decel_lim_x_mps2=4.0)
    readings = measured(scenario, (Command(1.0, 0.0), 30), (STOP, 4))
    assert readings[2:, 3] == pytest.approx(np.full(2, -4.0), rel=within)


def test_accelerations_add_up_to_the_velocity_even_while_the_robot_rocks():
    """Up to the change of the orientation within a period."""
    velocity = np.zeros(3)
    with HallwayWorld(silent("physical"), seed=1) as world:
        world.reset(0)
        world._robot.place(standing_at((3.0, 8.0, 0.5)))
        world.step(STOP)
        turns = [world._robot.inertial.turn]
        begun = np.array(world._robot.inertial.velocity_mps)
        for tick in range(60):
            world.step(Command(0.8, 0.6) if tick < 40 else STOP)
            turns.append(world._robot.inertial.turn)
            middle = np.array(turns[-2]) + np.array(turns[-1])
            middle = tuple((middle / np.linalg.norm(middle)).tolist())
            force = np.array(rotated(middle, world.imu.acceleration_mps2))
            velocity += STEP_S * (force - (0.0, 0.0, GRAVITY))
        ended = np.array(world._robot.inertial.velocity_mps)
    assert velocity == pytest.approx(ended - begun, abs=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle_rad", [-0.4, 1e-9, 0.7, 3.0])
def test_the_angular_velocity_is_the_turn_of_the_body_over_the_period(axis, angle_rad):
    start = Inertial((0.0, 0.0, math.sin(0.3), math.cos(0.3)), (0.0, 0.0, 0.0))
    turn = [0.0, 0.0, 0.0, math.cos(0.5 * angle_rad)]
    turn[axis] = math.sin(0.5 * angle_rad)
    imu = Imu(ImuSettings(**SILENT), STEP_S, start, np.random.default_rng(1))
    imu.follow(Inertial(product(start.turn, tuple(turn)), start.velocity_mps))
    expected = np.zeros(3)
    expected[axis] = angle_rad / STEP_S
    assert imu.reading.angular_velocity_radps == pytest.approx(expected.tolist(), abs=1e-9)


def readings_at_rest(settings, n_readings=4000):
    rest = Inertial((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    imu = Imu(settings, STEP_S, rest, np.random.default_rng(5))
    readings = []
    for _ in range(n_readings):
        imu.follow(rest)
        readings.append((*imu.reading.angular_velocity_radps, *imu.reading.acceleration_mps2))
    return np.array(readings) - (0.0, 0.0, 0.0, 0.0, 0.0, GRAVITY)


def test_white_noise_has_the_density_over_the_root_of_the_period():
    noise = readings_at_rest(ImuSettings(gyroscope_bias_walk=0.0, accelerometer_bias_walk=0.0))
    expected = np.repeat([1.7e-4, 2.0e-3], 3) / math.sqrt(STEP_S)
    assert noise.std(axis=0) == pytest.approx(expected, rel=0.05)
    correlation = np.corrcoef(noise[:-1, 0], noise[1:, 0])[0, 1]
    assert abs(correlation) < 4.0 / math.sqrt(len(noise))


def test_biases_walk_with_the_root_of_time():
    silent_but = SILENT | {"gyroscope_bias_walk": 2e-5, "accelerometer_bias_walk": 3e-3}
    steps = np.diff(readings_at_rest(ImuSettings(**silent_but)), axis=0)
    expected = np.repeat([2e-5, 3e-3], 3) * math.sqrt(STEP_S)
    assert steps.std(axis=0) == pytest.approx(expected, rel=0.05)


def test_readings_do_not_change_trajectories_and_repeat_with_the_seed():
    def drive(settings):
        scenario = load_scenario("hallway").model_copy(update={"imu": settings})
        with HallwayWorld(scenario, seed=4) as world:
            world.reset(1)
            seen = [world.step(Command(0.5, 0.2)).pose for _ in range(20)]
            return seen, world.imu

    (noisy, first), (again, second) = drive(ImuSettings()), drive(ImuSettings())
    exact, without = drive(ImuSettings(**SILENT))
    assert noisy == again == exact
    assert first == second != without


def test_negative_noise_is_rejected():
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        ImuSettings(gyroscope_noise_density=-1e-4)


def test_the_bumper_measures_the_momentum_that_a_wall_takes():
    """The sum of the impulses is m v where wheels roll freely and the robot does not bounce."""
    with HallwayWorld(silent("physical", wheel_torque_nm=1e-9), seed=1) as world:
        world.reset(0)
        world._robot._dynamics.place(RobotState(5.6, 8.0, (0.0, 1.0), 0.8))
        world._robot._measure_walls()
        touched = []
        for _ in range(40):
            world.step(STOP)
            touched += world.bumper
        after_mps = world._robot._dynamics.state().velocity_mps[0]
    total = sum(each.impulse_ns for each in touched)
    assert total == pytest.approx(ROBOT_KG * (0.8 - after_mps), rel=0.02)
    for each in touched:
        assert each.place_m == pytest.approx((0.25, 0.0), abs=0.01)
