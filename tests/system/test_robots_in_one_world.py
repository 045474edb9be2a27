"""Two robots in one world by one command: each with its stack, both among the same people."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from serd_app.navigation.arrival_log import load_arrivals
from serd_cli.processes.workspace import LOOPBACK_PROFILE
from serd_ros.convert.diagnostics import values_of
from serd_ros.endpoints import qos
from sim.drivers.expert import ScriptedExpert
from sim.planning.catalogue import make_planner
from sim.safety.world_guard import WorldGuard
from sim.scenario.scenario import load_scenario
from sim.world.command import STOP
from sim.world.shared_world import SharedWorld
from sim.world.waypoint import is_decision_tick, waypoint_of_intent
from storage.episode_table import load_episodes
from support.recorded_messages import recorded
from support.waiting import LOCKSTEP_TIMEOUT_S, PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.slow]
SERD = str(Path(sys.executable).with_name("serd"))
ROBOTS, SEED, EPISODES, TIMEOUT_S = ("robot1", "robot2"), 11, 2, 6.0


class Driven:
    """A robot of a world in process, with all that decides for it."""

    def __init__(self, world):
        scenario = world.scenario
        self.world, self.guard = world, WorldGuard(world)
        self.planner, self.driver = make_planner("dwa", scenario), ScriptedExpert(scenario, SEED)

    def begin(self, episode):
        self.planner.reset()
        self.driver.begin(episode)

    def command(self, observation):
        if is_decision_tick(observation, self.world.scenario):
            action = self.driver.decide(observation)
            self.waypoint = waypoint_of_intent(self.world.grid, observation, action)
        return self.guard(observation, self.planner.step(observation, self.waypoint))


def drive_in_process():
    """(2, N, 2) places of both robots in all episodes; those that share a world are kinematic."""
    scenario, places = load_scenario("hallway").with_values("robot", drive="kinematic"), []
    with SharedWorld(scenario, seed=SEED, robots=len(ROBOTS)) as shared:
        driven = [Driven(world) for world in shared.worlds]
        for episode in range(EPISODES):
            seen = shared.reset(episode)
            for each in driven:
                each.begin(episode)
            places.append([each.pose[:2] for each in seen])
            for _ in range(round(TIMEOUT_S / scenario.control_period_s)):
                commands = [
                    each.command(now) if not each.world.in_goal else STOP
                    for each, now in zip(driven, seen, strict=True)
                ]
                seen = shared.step(commands)
                places.append([each.pose[:2] for each in seen])
    return np.array(places).transpose(1, 0, 2)


def patient(environment, folder):
    """With a lease of ten minutes: the machine may stand still, and no node is killed here."""
    profile, announcement = folder / "patient.xml", "<leaseAnnouncement>"
    text = LOOPBACK_PROFILE.read_text()
    assert announcement in text
    lease = "<leaseDuration><sec>600</sec></leaseDuration>"
    profile.write_text(text.replace(announcement, lease + announcement))
    return environment | {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)}


def launch(environment, folder, *words):
    with (folder / "launch.log").open("wb") as log:
        return subprocess.Popen(
            [SERD, "launch", *words, "robots:=[robot1, robot2]", f"seed:={SEED}",
             f"lockstep_timeout_s:={LOCKSTEP_TIMEOUT_S}"],
            env=patient(environment, folder), cwd=folder, stdout=log, stderr=log,
        )  # fmt: skip


def end(process):
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    process.wait(PATIENCE_S)


def test_two_robots_in_one_world_drive_to_the_bit_as_in_process(ros_env, tmp_path):
    process = launch(
        ros_env, tmp_path, "demonstrate", f"episodes:={EPISODES}", f"timeout_s:={TIMEOUT_S}",
        "scripted_expert.output:=tables",
    )  # fmt: skip
    try:
        expected = drive_in_process()
        assert process.wait(PATIENCE_S) == 0, (tmp_path / "launch.log").read_text()
    finally:
        end(process)
    for robot, places_m in zip(ROBOTS, expected, strict=True):
        poses = recorded(tmp_path / robot / "recording", f"/{robot}/robot_pose")
        here_m = np.array([(each.pose.position.x, each.pose.position.y) for each in poses])
        assert np.array_equal(here_m, places_m)
        rows = load_episodes(tmp_path / robot / "tables" / "episodes.csv")
        assert [row.outcome for row in rows] == ["timeout"] * EPISODES
        people = recorded(tmp_path / robot / "recording", f"/{robot}/pedestrians")
        assert {each.width for each in people} == {load_scenario("hallway").pedestrians.count + 1}


def test_two_robots_reach_goals_of_their_own_without_contact(
    ros_env, probe, tmp_path, save_model_of, quick_hallway
):
    goals, reports = {"robot1": (12.5, 18.5), "robot2": (1.5, 10.5)}, {}
    for robot in goals:

        def take(message, robot=robot):
            reports[robot] = values_of(message, "hallway_sim") or reports.get(robot)

        topic = f"/{robot}/diagnostics"
        probe.node.create_subscription(DiagnosticArray, topic, take, qos.STATE)
    words = [f"{robot}.goal:={x_m}, {y_m}" for robot, (x_m, y_m) in goals.items()]
    process = launch(
        ros_env, tmp_path, "navigate", *words, f"model:={save_model_of()}", "episodes:=1",
        "people:=6", "output:=drives", f"scenario:={quick_hallway}",
    )  # fmt: skip
    try:
        probe.spin_until(lambda: process.poll() is not None)
        assert process.poll() == 0, (tmp_path / "launch.log").read_text()
    finally:
        end(process)
    for robot, goal in goals.items():
        (row,) = load_arrivals(tmp_path / robot / "drives" / "arrivals.csv")
        assert (row.goal_x_m, row.goal_y_m) == goal
        assert row.outcome == "arrived"
        (drive,) = load_episodes(tmp_path / robot / "drives" / "episodes.csv")
        assert drive.robot_on_person == drive.robot_on_wall == 0
        assert reports[robot]["robot_on_robot"] == "0"
        assert 0.0 < float(reports[robot]["minimum_robot_distance_m"]) < 5.0
