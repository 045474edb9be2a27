"""Two robots in namespaces of one ROS domain, each with its world, drive as if they were alone."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from serd_bag.reader import BagReader
from serd_files.episode_table import load_episodes
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.recorded_messages import recorded
from support.waiting import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.slow]
SERD = str(Path(sys.executable).with_name("serd"))
SEEDS, TIMEOUT_S = {"robot1": 11, "robot2": 12}, 6.0


def drive_alone(seed):
    """(N, 2) places of an episode in process."""
    scenario, places = load_scenario("hallway"), []
    with HallwayWorld(scenario, seed=seed) as world:
        run_episode(
            world,
            make_planner("dwa", scenario),
            ScriptedExpert(scenario, seed),
            episode=0,
            timeout_s=TIMEOUT_S,
            observer=lambda observation, *_: places.append(observation.pose[:2]),
        )
    return np.array(places)


def launch(robot, folder, environment):
    words = [
        "demonstrate", f"namespace:={robot}", f"frame_prefix:={robot}/", f"seed:={SEEDS[robot]}",
        "episodes:=1", f"timeout_s:={TIMEOUT_S}", f"demo_recorder.output:={folder / robot / 'bag'}",
        f"scripted_expert.output:={folder / robot}",
    ]  # fmt: skip
    with (folder / f"{robot}.log").open("wb") as log:
        return subprocess.Popen([SERD, "launch", *words], env=environment, stdout=log, stderr=log)


def test_two_robots_in_one_domain_drive_to_the_bit_as_alone(ros_env, tmp_path):
    started = {robot: launch(robot, tmp_path, ros_env) for robot in SEEDS}
    try:
        expected = {robot: drive_alone(seed) for robot, seed in SEEDS.items()}
        for robot, process in started.items():
            assert process.wait(PATIENCE_S) == 0, (tmp_path / f"{robot}.log").read_text()
    finally:
        for process in started.values():
            process.terminate()
            process.wait(PATIENCE_S)
    for robot in SEEDS:
        bag = tmp_path / robot / "bag"
        assert all(name.startswith(f"/{robot}/") for name in BagReader(bag).topics)
        poses = recorded(bag, f"/{robot}/robot_pose")
        places = np.array([(each.pose.position.x, each.pose.position.y) for each in poses])
        assert np.array_equal(places[: len(expected[robot])], expected[robot])
        odometry = recorded(bag, f"/{robot}/odom")[0]
        assert odometry.header.frame_id == f"{robot}/odom"
        assert odometry.child_frame_id == f"{robot}/base_link"
        assert recorded(bag, f"/{robot}/cmd_vel")[0].header.frame_id == f"{robot}/base_link"
        (row,) = load_episodes(tmp_path / robot / "episodes.csv")
        assert (row.seed, row.outcome) == (SEEDS[robot], "timeout")
