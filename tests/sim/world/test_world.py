"""The world: one seed one trajectory, exact motion, solid walls, contacts classified."""

import math
import subprocess
import sys
from dataclasses import replace

import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.robot.robot import standing_at
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
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
        standing = standing_at((3.0, 8.0, 0.0))
        world._robot.place(replace(standing, speed_mps=0.5, yaw_rate_radps=1.0))
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
        world._robot.place(standing_at((3.0, 5.0, math.pi / 2)))
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
