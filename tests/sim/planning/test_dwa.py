"""Parts of the dynamic window planner."""

import numpy as np
import pytest

from sim.planning.rollouts import reachable_window, roll_out
from sim.robot.unicycle import chord_velocity, limited_velocity
from sim.scenario.settings import RobotSettings
from sim.world.command import Command

ROBOT = RobotSettings()


def test_the_window_holds_what_the_accelerations_allow():
    window = reachable_window(ROBOT, 0.5, 1.0, 0.1)
    assert (window.slowest_mps, window.fastest_mps) == pytest.approx((0.25, 0.75))
    assert (window.rightmost_radps, window.leftmost_radps) == pytest.approx((-0.2, 2.2))


def test_rollouts_end_where_the_limited_unicycle_ends():
    time_s = 0.05 * np.arange(1, 21)
    rollouts = roll_out(
        (1.0, 2.0, 0.3),
        (0.2, np.array([1.0])),
        (0.0, np.array([-2.0])),
        ROBOT,
        time_s,
        turn_time_s=2.0,
    )
    expected, _ = _constant_command((1.0, 2.0, 0.3), 0.2, 1.0, -2.0)
    assert rollouts.x_m[0, 0, -1] == pytest.approx(expected[0], abs=0.04)
    assert rollouts.y_m[0, 0, -1] == pytest.approx(expected[1], abs=0.04)


def _constant_command(pose, speed, wanted_speed, wanted_turn):
    turn = 0.0
    for _ in range(20):
        speed, turn = limited_velocity(Command(wanted_speed, wanted_turn), speed, turn, ROBOT, 0.05)
        vx, vy = chord_velocity(pose[2], speed, turn, 0.05)
        pose = (pose[0] + 0.05 * vx, pose[1] + 0.05 * vy, pose[2] + 0.05 * turn)
    return pose, speed
