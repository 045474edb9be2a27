"""One seed gives one trajectory, in process and through ROS in lock-step, bit for bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from serd_app.drives.episode_spans import START
from serd_files.episode_table import load_episodes
from serd_files.yaml_config import model_yaml
from serd_ros.convert.pose import from_pose
from serd_ros.convert.stamp import stamp_s
from serd_sim.drivers.catalogue import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.perception.scanning_planner import planner_in_world
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.recorded_messages import recorded
from support.waiting import PATIENCE_S

SEEDS, EPISODES, TIMEOUT_S = {"robot1": 11, "robot2": 12}, 2, 6.0
SLIPPING_S = 16.0
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


def noisy_hallway(folder):
    """The hallway with a noisy lidar and wheels that slip, as a file."""
    hallway = load_scenario("hallway")
    robot = hallway.robot.model_copy(update={"drive": "kinematic"})
    lidar = hallway.lidar.model_copy(update={"noise_deviation_m": 0.02})
    slip = hallway.odometry.model_copy(
        update={"distance_scale_deviation": 0.05, "distance_noise_m": 0.02}
    )
    path = folder / "noisy.yaml"
    parts = {"robot": robot, "lidar": lidar, "odometry": slip}
    path.write_text(model_yaml(hallway.model_copy(update=parts)))
    return path


def test_scans_alone_and_slipping_wheels_give_the_same_through_ros(nodes, tmp_path):
    """The planner node gets no people; /odom is the pose by the wheels alone."""
    path, bag = noisy_hallway(tmp_path), tmp_path / "bag"
    processes = nodes.start_stack(
        "demonstrate",
        scenario=str(path),
        seed=SEEDS["robot1"],
        episodes=1,
        timeout_s=SLIPPING_S,
        people_from="scan",
        demo_recorder__output=str(bag),
    )
    scenario = load_scenario(path)
    with HallwayWorld(scenario, seed=SEEDS["robot1"]) as world:
        planner, expert = (
            planner_in_world(world, "scan"),
            ScriptedExpert(scenario, SEEDS["robot1"]),
        )
        poses, odometry = [], []

        def look(observation, *_):
            poses.append(observation.pose)
            odometry.append(world.odometry_pose)

        run_episode(world, planner, expert, episode=0, timeout_s=SLIPPING_S, observer=look)
    assert processes["scripted_expert"].wait(PATIENCE_S) == 0, nodes.log_of("scripted_expert")
    nodes.end_all()

    places = places_of(each.pose.position for each in recorded(bag, "/robot_pose"))
    assert np.array_equal(places[: len(poses)], np.array(poses)[:, :2])
    wheels = places_of(each.pose.pose.position for each in recorded(bag, "/odom"))
    assert np.array_equal(wheels[: len(poses)], np.array(odometry)[:, :2])
    assert np.hypot(*(wheels[len(poses) - 1] - places[len(poses) - 1])) > 0.1


def places_of(positions):
    """(N, 2) x and y."""
    return np.array([(each.x, each.y) for each in positions])
