"""The world: one seed one trajectory, exact motion, solid walls, contacts classified."""

import math
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serd_files.errors import USER_ERRORS
from serd_sim.crowd.robots import RobotBody
from serd_sim.robot.robot import ContactCounter, ContactCounts, Touches
from serd_sim.scenario.scenario import load_scenario
from serd_sim.scenario.settings import RobotSettings
from serd_sim.world.command import STOP, Command, limited_velocity
from serd_sim.world.observation import EPISODE_GAP_S, is_next_episode
from serd_sim.world.world import HallwayWorld

HALLWAY = load_scenario("hallway")
EMPTY = HALLWAY.with_pedestrian_count(0)
KINEMATIC = EMPTY.with_values("robot", drive="kinematic")


def trajectory(seed=11, episodes=(2,)):
    """Poses and people of the last of the episodes, exactly."""
    with HallwayWorld(HALLWAY, seed=seed) as world:
        for episode in episodes:
            seen = [world.reset(episode)]
            turns = (0.4 if tick % 40 < 20 else -0.4 for tick in range(57))
            seen += [world.step(Command(0.5, turn)) for turn in turns]
    return [(each.pose, each.people_position_m.tobytes()) for each in seen]


PROGRAM = "from tests.sim.world.test_world import trajectory; print(trajectory())"


def test_one_seed_gives_the_same_trajectory_in_every_process_and_after_other_episodes():
    command = [sys.executable, "-W", "error", "-c", PROGRAM]
    there = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    here = trajectory()
    assert there.strip() == repr(here)
    assert trajectory(episodes=[1, 4, 2]) == here
    for other in (trajectory(seed=1), trajectory(episodes=[3])):
        assert other[0][1] != here[0][1]


def test_time_runs_on_over_episodes_and_leaves_a_gap_that_observations_show():
    period_s = EMPTY.control_period_s
    with HallwayWorld(EMPTY, seed=1) as world:
        assert world.reset(0).tick == 0
        seen = [world.step(STOP) for _ in range(45)]
        begun = world.reset(1)
        gap_s = begun.time_s - seen[-1].time_s
        assert EPISODE_GAP_S - 1e-9 <= gap_s < EPISODE_GAP_S + 1.0 / EMPTY.lidar.rate_hz
        assert world.is_scan_tick
    assert is_next_episode(seen[-1], begun, period_s)
    assert is_next_episode(seen[-1], seen[0], period_s), "a world that begins anew"
    assert not is_next_episode(seen[0], seen[30], period_s), "ticks that a live clock skipped"


def test_a_constant_command_drives_the_exact_circle():
    with HallwayWorld(KINEMATIC, seed=1) as world:
        world.reset(0)
        world._robot.place((3.0, 8.0, 0.0), speed_mps=0.5, yaw_rate_radps=1.0)
        for _ in range(100):
            seen = world.step(Command(0.5, 1.0))
    expected = 3.0 + 0.5 * math.sin(5.0), 8.0 + 0.5 * (1 - math.cos(5.0)), 5.0 - 2 * math.pi
    assert seen.pose == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("scenario", "bad", "rocking_mps"), [(KINEMATIC, math.nan, 0.0), (EMPTY, math.inf, 1e-3)]
)
def test_a_command_that_is_not_finite_stops_the_robot(scenario, bad, rocking_mps):
    with HallwayWorld(scenario, seed=1) as world:
        world.reset(0)
        world._robot.place((3.0, 5.0, math.pi / 2))
        for command in [Command(1.0, 0.0)] * 20 + [Command(bad, 0.0)] * 10:
            seen = world.step(command)
        assert abs(seen.speed_mps) <= rocking_mps
        assert world.n_rejected_commands == 10


def test_a_step_before_a_reset_is_refused_with_the_fix_and_the_goal_may_move():
    with HallwayWorld(EMPTY, seed=1) as world:
        with pytest.raises(USER_ERRORS, match=r"call reset\(episode\) first"):
            world.step(STOP)
        world.reset(0)
        assert not world.in_goal
        world.goal_area_m = ((0.0, 0.0), (6.0, 0.0), (6.0, 24.0), (0.0, 24.0))
        assert world.in_goal


FAR_FROM_WALLS_M = 5.0


class Crowd(SimpleNamespace):
    """What the counter asks of a crowd."""

    def __len__(self):
        return len(self.x_m)


def crowd_at(*x_m, velocity_x_mps=0.0):
    """People in front of the robot, on its line."""
    x_m = np.array(x_m)
    y_m, velocity_mps = np.zeros_like(x_m), np.full_like(x_m, velocity_x_mps)
    velocity = {"velocity_x_mps": velocity_mps, "velocity_y_mps": y_m}
    return Crowd(x_m=x_m, y_m=y_m, **velocity, body_radius_m=0.25)


def robot(velocity_x_mps=0.0):
    return RobotBody(0.0, 0.0, velocity_x_mps, 0.0, 0.25)


@pytest.mark.parametrize(
    ("robots_mps", "persons_mps", "who"),
    [
        (0.5, 0.4, "robot"),  # it catches up with a person who walks away
        (0.5, -0.4, "robot"),  # both approach, the robot faster
        (0.4, -0.5, "person"),  # both approach, the person faster
        (-0.3, -0.5, "person"),  # the person catches up with a robot that backs off
        (0.0, 0.0, "person"),  # a robot at rest does not run into people
    ],
)
def test_a_contact_is_of_the_one_who_closes_in_faster(robots_mps, persons_mps, who):
    counter = ContactCounter(1)
    counter.update(crowd_at(0.49, velocity_x_mps=persons_mps), robot(robots_mps), FAR_FROM_WALLS_M)
    counted = counter.counts.robot_on_person, counter.counts.person_on_robot
    assert counted == (who == "robot", who == "person")


def test_a_bump_that_trembles_counts_once_and_one_after_parting_again():
    counter = ContactCounter(1)
    counted, gaps_m = [], []
    for x_m in (0.8, 0.49, 0.52, 0.49, 0.53, 0.45, 0.56, 0.49):
        counter.update(crowd_at(x_m), robot(), FAR_FROM_WALLS_M)
        counted.append(counter.counts.person_on_robot)
        gaps_m.append(counter.minimum_distance_m)
    assert counted == [0, 1, 1, 1, 1, 1, 1, 2]
    assert gaps_m == pytest.approx([0.3, *[-0.01] * 4, *[-0.05] * 3])


def test_alone_the_robot_touches_walls_only():
    counter = ContactCounter(0)
    for distance_m in (0.3, 0.24, 0.26, 0.24, 0.4, 0.24):
        counter.update(crowd_at(), robot(0.5), distance_m)
    assert counter.counts.robot_on_wall == 2
    assert counter.minimum_distance_m == np.inf


def test_touches_of_the_physics_count_as_they_are():
    """Circles that overlap do not; a person 3 cm away has bounced off within the period."""
    counter = ContactCounter(1)
    counter.update(crowd_at(0.49), robot(), 0.24, Touches({}, False))
    assert counter.counts == ContactCounter(1).counts
    for people, wall, x_m in (
        ({0: True}, False, 0.53),
        ({}, False, 0.52),
        ({0: False}, False, 0.5),  # still the same contact
        ({}, False, 0.6),
        ({0: False}, True, 0.5),
    ):
        counter.update(crowd_at(x_m), robot(), FAR_FROM_WALLS_M, Touches(people, wall))
    assert counter.counts == ContactCounts(1, 1, 1)


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
