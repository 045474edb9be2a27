"""One seed gives one trajectory, in process and through ROS in lock-step, bit for bit."""

from functools import cache

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from serd_cli.demo.report import read_recording
from serd_files.episode_table import load_episodes
from serd_files.yaml_config import model_yaml
from serd_sim.drivers.expert import ScriptedExpert
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.catalogue import make_planner, planner_in_world
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld
from support.recorded_messages import recorded
from support.waiting import PATIENCE_S

SEED, EPISODES, TIMEOUT_S = 11, 2, 16.0
pytestmark = [pytest.mark.ros, pytest.mark.slow]


@cache
def drive_in_process():
    scenario = load_scenario("hallway")
    poses, records = [], []
    with HallwayWorld(scenario, seed=SEED) as world:
        planner, expert = make_planner("dwa", scenario), ScriptedExpert(scenario, SEED)
        for episode in range(EPISODES):
            seen = []
            record = run_episode(
                world,
                planner,
                expert,
                episode=episode,
                timeout_s=TIMEOUT_S,
                observer=lambda observation, *_, seen=seen: seen.append(observation.pose),
            )
            seen.append(world.observation.pose)
            poses.append(np.array(seen))
            records.append(record)
    return poses, records


def test_a_seed_gives_the_same_trajectory_in_process_and_through_ros(nodes, tmp_path):
    bag = tmp_path / "bag"
    processes = nodes.start_stack(
        "demonstrate",
        seed=SEED,
        episodes=EPISODES,
        timeout_s=TIMEOUT_S,
        demo_recorder__output=str(bag),
        scripted_expert__output=str(tmp_path),
    )
    expected_poses, records = drive_in_process()
    assert processes["scripted_expert"].wait(PATIENCE_S) == 0, nodes.log_of("scripted_expert")
    nodes.end_all()

    rows = load_episodes(tmp_path / "episodes.csv")
    assert [row.outcome for row in rows] == [r.outcome for r in records] == ["timeout"] * EPISODES
    assert [row.distance_m for row in rows] == [r.distance_m for r in records]
    assert [row.person_on_robot for row in rows] == [r.contacts.person_on_robot for r in records]
    recording = read_recording(bag)
    assert len(recording.poses) == EPISODES
    for driven, expected in zip(recording.poses, expected_poses, strict=True):
        # Positions are doubles all the way and equal to the last bit; the yaw went through a
        # quaternion, so it is compared in the single precision that observations carry. The world
        # goes on after a time-out until the next reset.
        driven = driven[: len(expected)]
        assert np.array_equal(driven[:, :2], expected[:, :2])
        assert np.array_equal(driven[:, 2].astype(np.float32), expected[:, 2].astype(np.float32))
    assert_nothing_was_lost(bag, sum(len(poses) for poses in expected_poses))


def noisy_hallway(folder, drive):
    """The hallway with a noisy lidar and wheels that slip, as a file."""
    hallway = load_scenario("hallway")
    robot = hallway.robot.model_copy(update={"drive": drive})
    lidar = hallway.lidar.model_copy(update={"noise_deviation_m": 0.02})
    slip = hallway.odometry.model_copy(
        update={"distance_scale_deviation": 0.05, "distance_noise_m": 0.02}
    )
    path = folder / "noisy.yaml"
    parts = {"robot": robot, "lidar": lidar, "odometry": slip}
    path.write_text(model_yaml(hallway.model_copy(update=parts)))
    return path


@pytest.mark.parametrize("drive", ["kinematic", "physical"])
def test_scans_alone_and_slipping_wheels_give_the_same_through_ros(nodes, tmp_path, drive):
    """The planner node gets no people; /odom is the pose by the wheels alone."""
    path, bag = noisy_hallway(tmp_path, drive), tmp_path / "bag"
    processes = nodes.start_stack(
        "demonstrate",
        scenario=str(path),
        seed=SEED,
        episodes=1,
        timeout_s=TIMEOUT_S,
        people_from="scan",
        demo_recorder__output=str(bag),
    )
    scenario = load_scenario(path)
    with HallwayWorld(scenario, seed=SEED) as world:
        planner, expert = planner_in_world("dwa", world, "scan"), ScriptedExpert(scenario, SEED)
        poses, odometry = [], []

        def look(observation, *_):
            poses.append(observation.pose)
            odometry.append(world.odometry_pose)

        run_episode(world, planner, expert, episode=0, timeout_s=TIMEOUT_S, observer=look)
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


def assert_nothing_was_lost(bag, n_ticks):
    """No tick without its messages; the last tick of an episode has no command."""
    with AnyReader([bag]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert counts["/robot_pose"] >= n_ticks
    assert counts["/cmd_vel"] >= n_ticks - EPISODES
    assert counts["/odom"] == counts["/pedestrians"] == counts["/robot_pose"]
    assert counts["/episode"] == 2 * EPISODES
