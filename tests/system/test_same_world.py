"""One seed gives one trajectory, in process and through ROS in lock-step, bit for bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from serd_app.drives.drive import START
from serd_files.table import load_episodes
from serd_ros.convert.motion import from_pose
from serd_ros.convert.stamp import stamp_s
from serd_sim.drivers.catalogue import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.waiting import PATIENCE_S

SEEDS, EPISODES, TIMEOUT_S = {"robot1": 11, "robot2": 12}, 2, 6.0
SERD = str(Path(sys.executable).with_name("serd"))
pytestmark = [pytest.mark.ros, pytest.mark.slow]


def drive_alone(seed, episodes=1, timeout_s=TIMEOUT_S):
    """(N, 3) poses of each episode in process, and its record."""
    scenario, driven = load_scenario("hallway"), []
    with HallwayWorld(scenario, seed=seed) as world:
        planner, expert = make_planner(scenario), ScriptedExpert(scenario, seed)
        for episode in range(episodes):
            poses = []
            record = run_episode(
                world, planner, expert, episode=episode, timeout_s=timeout_s,
                observer=lambda observation, *_, poses=poses: poses.append(observation.pose),
            )  # fmt: skip
            driven.append((np.array([*poses, world.observation.pose]), record))
    return driven


def recorded(bag, topic):
    """The first message of each stamp, in their order."""
    found = {}
    with AnyReader([bag]) as reader:
        wanted = [each for each in reader.connections if each.topic == topic]
        for connection, _, raw in reader.messages(wanted):
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault((message.header.stamp.sec, message.header.stamp.nanosec), message)
    return [found[stamp] for stamp in sorted(found)]


def launch(robot, folder, environment):
    words = [
        "demonstrate", f"namespace:={robot}", f"frame_prefix:={robot}/", f"seed:={SEEDS[robot]}",
        f"episodes:={EPISODES}", f"timeout_s:={TIMEOUT_S}",
        f"demo_recorder.output:={folder / robot / 'bag'}",
        f"scripted_expert.output:={folder / robot}",
    ]  # fmt: skip
    with (folder / f"{robot}.log").open("wb") as log:
        return subprocess.Popen([SERD, "launch", *words], env=environment, stdout=log, stderr=log)


def test_two_robots_in_one_domain_drive_to_the_bit_as_in_process(ros_env, tmp_path):
    started = {robot: launch(robot, tmp_path, ros_env) for robot in SEEDS}
    try:
        alone = {robot: drive_alone(seed, EPISODES) for robot, seed in SEEDS.items()}
        for robot, process in started.items():
            assert process.wait(PATIENCE_S) == 0, (tmp_path / f"{robot}.log").read_text()
    finally:
        for process in started.values():
            process.terminate()
            process.wait(PATIENCE_S)
    for robot, seed in SEEDS.items():
        bag, records = tmp_path / robot / "bag", [record for _, record in alone[robot]]
        rows = load_episodes(tmp_path / robot / "episodes.csv")
        assert [(row.seed, row.outcome) for row in rows] == [(seed, "timeout")] * EPISODES
        assert [row.distance_m for row in rows] == [each.distance_m for each in records]
        assert [row.person_on_robot for row in rows] == [
            each.contacts.person_on_robot for each in records
        ]
        poses = recorded(bag, f"/{robot}/robot_pose")
        at_s = np.array([stamp_s(each.header.stamp) for each in poses])
        driven = np.array([from_pose(each.pose) for each in poses])
        marks = recorded(bag, f"/{robot}/episode")
        starts_s = [stamp_s(each.header.stamp) for each in marks if each.status[0].message == START]
        for start_s, (expected, _) in zip(starts_s, alone[robot], strict=True):
            # The yaw went through a quaternion; observations carry single precision. The world
            # goes on after a time-out until the next reset.
            begun = driven[at_s >= start_s - 1e-6][: len(expected)]
            assert np.array_equal(begun[:, :2], expected[:, :2])
            assert np.array_equal(begun[:, 2].astype("f4"), expected[:, 2].astype("f4"))
        odometry = recorded(bag, f"/{robot}/odom")[0]
        assert odometry.header.frame_id == f"{robot}/odom"
        assert odometry.child_frame_id == f"{robot}/base_link"
        assert recorded(bag, f"/{robot}/cmd_vel")[0].header.frame_id == f"{robot}/base_link"
        assert_nothing_was_lost(bag, robot, sum(len(poses) for poses, _ in alone[robot]))


def assert_nothing_was_lost(bag, robot, n_ticks):
    """No tick without its messages; the last tick of an episode has no command."""
    with AnyReader([bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert all(name.startswith(f"/{robot}/") for name in counts)
    counts = {name.removeprefix(f"/{robot}/"): count for name, count in counts.items()}
    assert counts["robot_pose"] >= n_ticks
    assert counts["cmd_vel"] >= n_ticks - EPISODES
    assert counts["odom"] == counts["pedestrians"] == counts["robot_pose"]
    assert counts["episode"] == 2 * EPISODES
