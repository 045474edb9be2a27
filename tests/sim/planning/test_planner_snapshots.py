"""A planner's snapshot, with that of its world, repeats what followed bit for bit."""

import pickle
import subprocess
import sys

import pytest

from serd_sim.planning.catalogue import (
    PEOPLE_SOURCES,
    planner_in_world,
    planner_names,
)
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld

NOISY = load_scenario("hallway")
NOISY = NOISY.model_copy(
    update={
        "lidar": NOISY.lidar.model_copy(update={"noise_deviation_m": 0.02}),
        "odometry": NOISY.odometry.model_copy(update={"distance_noise_m": 0.05}),
    }
)
AHEAD = Waypoint(3.0, 12.0)

RESTORING_PROGRAM = """
import pickle, sys
from tests.sim.planning.test_planner_snapshots import AHEAD, NOISY, drive
from serd_sim.planning.catalogue import planner_in_world
from serd_sim.world.world import HallwayWorld
with HallwayWorld(NOISY, seed=5) as world:
    planner = planner_in_world(sys.argv[1], world, sys.argv[2])
    world_state, planner_state = pickle.load(sys.stdin.buffer)
    world.restore(world_state)
    planner.restore(planner_state)
    sys.stdout.buffer.write(pickle.dumps(drive(world, planner, 40)))
"""


def drive(world, planner, n_ticks):
    """What is seen and commanded, exactly."""
    seen = []
    for _ in range(n_ticks):
        command = planner.step(world.observation, AHEAD)
        observation = world.step(command)
        seen.append((command, observation.pose, observation.people_position_m.tobytes()))
    return seen, world.odometry_pose, planner.status, planner.n_recoveries


@pytest.mark.parametrize("people_from", PEOPLE_SOURCES)
@pytest.mark.parametrize("name", planner_names())
def test_a_drive_goes_on_the_same_from_snapshots_also_in_another_process(name, people_from):
    with HallwayWorld(NOISY, seed=5) as world:
        world.reset(0)
        planner = planner_in_world(name, world, people_from)
        drive(world, planner, 31)
        states = pickle.dumps((world.snapshot(), planner.snapshot()))
        first = drive(world, planner, 40)
        world_state, planner_state = pickle.loads(states)  # noqa: S301 (made right here)
        world.restore(world_state)
        planner.restore(planner_state)
        assert drive(world, planner, 40) == first
    other = subprocess.run(
        [sys.executable, "-c", RESTORING_PROGRAM, name, people_from],
        input=states,
        capture_output=True,
        check=True,
    )
    assert pickle.loads(other.stdout) == first  # noqa: S301 (made right here)
