"""A planner's snapshot, with that of its world, repeats what followed bit for bit."""

import pickle
import subprocess
import sys

import pytest

from serd_sim.planning.catalogue import planner_in_world
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.waypoint import Waypoint
from serd_sim.world.world import HallwayWorld

NOISY = load_scenario("hallway").with_values("odometry", distance_noise_m=0.05)
NOISY = NOISY.with_values("lidar", noise_deviation_m=0.02)

RESTORING_PROGRAM = """
import pickle, sys
from tests.sim.planning.test_planner_snapshots import drive
states, *how = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(pickle.dumps(drive(*how, states)))
"""


def drive(name, people_from, states, n_ticks=40):
    """What is seen and commanded after restoring, exactly, and the states at the end."""
    with HallwayWorld(NOISY, seed=5) as world:
        world.reset(0)
        planner = planner_in_world(name, world, people_from)
        if states:
            world.restore(states[0])
            planner.restore(states[1])
        seen = []
        for _ in range(n_ticks):
            command = planner.step(world.observation, Waypoint(3.0, 12.0))
            observation = world.step(command)
            seen.append((command, observation.pose, observation.people_position_m.tobytes()))
        seen.append((world.odometry_pose, planner.status, planner.n_recoveries))
        return seen, (world.snapshot(), planner.snapshot())


@pytest.mark.parametrize(
    ("name", "people_from"), [("dwa", "scan"), ("dwa_smooth", "given"), ("mppi", "scan")]
)
def test_a_drive_goes_on_the_same_from_snapshots_also_in_another_process(name, people_from):
    whole, _ = drive(name, people_from, None, 71)
    _, states = drive(name, people_from, None, 31)
    first, _ = drive(name, people_from, states)
    assert first == whole[31:]
    given = pickle.dumps((states, name, people_from))
    command = [sys.executable, "-c", RESTORING_PROGRAM]
    other = subprocess.run(command, input=given, capture_output=True, check=True)
    assert pickle.loads(other.stdout)[0] == first  # noqa: S301 (made right here)
