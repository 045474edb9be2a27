"""Parts of the dynamic window planner."""

import numpy as np
import pytest

from sim.planning.catalogue import make_planner
from sim.planning.rollouts import reachable_window, roll_out
from sim.robot.unicycle import chord_velocity, limited_velocity
from sim.scenario.scenario import load_scenario
from sim.scenario.settings import RobotSettings
from sim.world.command import Command
from sim.world.waypoint import Waypoint
from support.observations import observation_at

ROBOT = RobotSettings()
HALLWAY = load_scenario("hallway")
AHEAD = Waypoint(3.0, 9.0)


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


def commands(observation):
    """Those of both kinds of the planner."""
    return [make_planner(name, HALLWAY).step(observation, AHEAD) for name in ("dwa", "dwa_smooth")]


@pytest.mark.parametrize("speed_mps", [0.0, 0.3, 0.8, 1.2])
@pytest.mark.parametrize("y_m", [2.0, 6.0, 8.4])
def test_the_smooth_planner_drives_a_sixth_of_the_way_to_the_chosen_speed(speed_mps, y_m):
    """Its time constant of 0.3 s is six control periods; it brakes at the waypoint as the other."""
    seen = observation_at(3.0, y_m, yaw_rad=np.pi / 2, speed_mps=speed_mps)
    direct, smooth = commands(seen)
    expected = speed_mps + (direct.linear_mps - speed_mps) / 6.0
    if y_m < 8.0:
        assert smooth.linear_mps == pytest.approx(expected)
    assert smooth.linear_mps <= max(expected, direct.linear_mps) + 1e-12
    assert smooth.angular_radps == direct.angular_radps


def test_the_smooth_planner_brakes_at_once_where_a_slower_approach_would_hit_a_person():
    seen = observation_at(
        3.0, 6.0, yaw_rad=np.pi / 2, speed_mps=1.2, people=((2.7, 7.0), (3.3, 7.0))
    )
    direct, smooth = commands(seen)
    assert direct.linear_mps < 0.5
    assert smooth == direct
