"""The robot's motion against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import STOP, Command, chord_velocity, limited_velocity

ROBOT = RobotSettings()


@given(
    v=st.floats(-10, 10), w=st.floats(-50, 50), speed=st.floats(-0.3, 1.2), turn=st.floats(-3, 3)
)
def test_no_command_breaks_a_limit_of_speed_or_acceleration(v, w, speed, turn):
    new_speed, new_turn = limited_velocity(Command(v, w), speed, turn, ROBOT, 0.05)
    assert ROBOT.min_vel_x_mps - 1e-12 <= new_speed <= ROBOT.max_vel_x_mps + 1e-12
    assert abs(new_turn) <= ROBOT.max_vel_theta_radps + 1e-12
    brakes = speed * np.sign(new_speed - speed) < 0.0
    limit_mps2 = ROBOT.decel_lim_x_mps2 if brakes else ROBOT.acc_lim_x_mps2
    assert abs(new_speed - speed) <= limit_mps2 * 0.05 + 1e-12
    assert abs(new_turn - turn) <= ROBOT.acc_lim_theta_radps2 * 0.05 + 1e-12


def test_a_stop_brakes_with_the_deceleration_limit_and_a_start_takes_the_acceleration_limit():
    speed, speeds = 1.2, []
    while speed > 0.0:
        speed, _ = limited_velocity(STOP, speed, 0.0, ROBOT, 0.05)
        speeds.append(speed)
    assert len(speeds) * 0.05 == pytest.approx(1.2 / 6.0, abs=0.05)
    assert limited_velocity(Command(1.2, 0.0), 0.0, 0.0, ROBOT, 0.05)[0] == 2.5 * 0.05
    assert limited_velocity(Command(-0.3, 0.0), 0.01, 0.0, ROBOT, 0.05)[0] == -2.5 * 0.05


@given(yaw=st.floats(-3, 3), speed=st.floats(-1, 1.2), turn=st.floats(-3.5, 3.5))
def test_the_chord_ends_where_the_arc_ends(yaw, speed, turn):
    vx, vy = chord_velocity(yaw, speed, turn, 0.05)
    steps = 2000
    middle = yaw + turn * 0.05 * (np.arange(steps) + 0.5) / steps
    assert vx == pytest.approx(speed * np.cos(middle).mean(), abs=1e-8)
    assert vy == pytest.approx(speed * np.sin(middle).mean(), abs=1e-8)
