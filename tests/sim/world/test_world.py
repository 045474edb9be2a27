"""The world: one seed one trajectory, exact motion, solid walls, contacts classified."""

import math
from dataclasses import replace

import numpy as np
import pytest

from serd_files.errors import USER_ERRORS
from serd_sim.robot.robot import standing_at
from serd_sim.scenario.occupancy import occupancy_raster
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.command import STOP, Command
from serd_sim.world.observation import EPISODE_GAP_S, is_next_episode
from serd_sim.world.world import HallwayWorld
from support.processes import outputs_of_processes

HALLWAY = load_scenario("hallway")
EMPTY = HALLWAY.with_pedestrian_count(0)
KINEMATIC = EMPTY.with_values("robot", drive="kinematic")

TRAJECTORY_PROGRAM = """
import hashlib
from serd_sim.world.command import Command
from serd_sim.robot.robot import standing_at
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
world = HallwayWorld(load_scenario("hallway"), seed=11)
world.reset(2)
digest = hashlib.sha256()
for tick in range(150):
    seen = world.step(Command(0.5, 0.4 if tick % 60 < 30 else -0.4))
    digest.update(repr(seen.pose).encode() + seen.people_position_m.tobytes())
print(digest.hexdigest())
"""


def place(world, x_m, y_m, yaw_rad, speed_mps=0.0, yaw_rate_radps=0.0):
    world.reset(0)
    standing = standing_at((x_m, y_m, yaw_rad))
    world._robot.place(replace(standing, speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps))


def test_one_seed_gives_the_same_trajectory_in_every_process():
    assert len(outputs_of_processes(TRAJECTORY_PROGRAM)) == 1


def test_an_episode_does_not_depend_on_the_episodes_before_it():
    def last_pose(episodes):
        with HallwayWorld(HALLWAY, seed=3) as world:
            for episode in episodes:
                world.reset(episode)
                for _ in range(57):
                    seen = world.step(Command(0.6, 0.2))
        return seen.pose, seen.people_position_m.tobytes()

    assert last_pose([5]) == last_pose([1, 4, 5])


def test_other_seeds_and_episodes_give_other_crowds():
    with HallwayWorld(HALLWAY, seed=1) as one, HallwayWorld(HALLWAY, seed=2) as two:
        first = one.reset(0).people_position_m
        assert not np.array_equal(first, two.reset(0).people_position_m)
        assert not np.array_equal(first, one.reset(1).people_position_m)


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
        place(world, 3.0, 8.0, 0.0, 0.5, 1.0)
        for _ in range(100):
            seen = world.step(Command(0.5, 1.0))
    radius, angle = 0.5, 5.0
    assert seen.x_m == pytest.approx(3.0 + radius * math.sin(angle), abs=1e-6)
    assert seen.y_m == pytest.approx(8.0 + radius * (1 - math.cos(angle)), abs=1e-6)
    assert seen.yaw_rad == pytest.approx(5.0 - 2 * math.pi, abs=1e-6)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize(("empty", "rocking_mps"), [(KINEMATIC, 0.0), (EMPTY, 1e-3)])
def test_a_command_that_is_not_finite_stops_the_robot(bad, empty, rocking_mps):
    with HallwayWorld(empty, seed=1) as world:
        place(world, 3.0, 5.0, math.pi / 2)
        for _ in range(20):
            world.step(Command(1.0, 0.0))
        for _ in range(10):
            seen = world.step(Command(bad, 0.0))
        assert abs(seen.speed_mps) <= rocking_mps
        assert world.n_rejected_commands == 10


def test_the_map_is_free_inside_occupied_at_the_walls_and_unknown_beyond():
    with HallwayWorld(EMPTY, seed=1) as world:
        raster = occupancy_raster(world.scenario, 0.1)

    def cell(x_m, y_m):
        column = int((x_m - raster.origin_m[0]) / raster.resolution_m)
        row = int((y_m - raster.origin_m[1]) / raster.resolution_m)
        return raster.cells[row, column]

    assert (cell(3.0, 3.0), cell(6.05, 8.0), cell(10.0, 5.0)) == (0, 100, -1)


def test_stepping_before_a_reset_is_refused_with_the_fix():
    with (
        HallwayWorld(EMPTY, seed=1) as world,
        pytest.raises(USER_ERRORS, match=r"call reset\(episode\) first"),
    ):
        world.step(STOP)


@pytest.mark.parametrize(
    ("scenario", "seed", "sentence"),
    [
        (EMPTY, 2, "make the world with seed=1"),
        (HALLWAY, 1, "must be of this world's scenario 'hallway' as it is"),
    ],
)
def test_a_snapshot_of_another_world_is_refused_with_the_fix(scenario, seed, sentence):
    with HallwayWorld(EMPTY, seed=1) as world, HallwayWorld(scenario, seed=seed) as other:
        world.reset(0)
        with pytest.raises(USER_ERRORS, match=sentence):
            other.restore(world.snapshot())


def test_a_snapshot_holds_the_goal_too():
    here = ((0.0, 0.0), (6.0, 0.0), (6.0, 24.0), (0.0, 24.0))
    with HallwayWorld(EMPTY, seed=1) as world:
        world.reset(0)
        state = world.snapshot()
        world.goal_area_m = here
        assert world.in_goal
        world.restore(state)
        assert not world.in_goal


def test_the_true_yaw_repeats_to_the_last_bit_after_a_restore():
    """Observations round the yaw; odometry that does not drift shows all of it."""
    with HallwayWorld(EMPTY, seed=1) as world:
        world.reset(3)
        path = []
        states = []
        for _ in range(40):
            states.append(world.snapshot())
            world.step(Command(0.3, 1.1))
            path.append(world.odometry_pose)
        for state, expected in zip(states, path, strict=True):
            world.restore(state)
            world.step(Command(0.3, 1.1))
            assert world.odometry_pose == expected
