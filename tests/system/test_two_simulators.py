"""One world per ROS domain: a second one is named, ends simulators, and stops drives and starts."""

import subprocess
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from serd_app.drives.episode_spans import END
from serd_cli.processes.node_commands import node_command
from serd_files.episode_table import load_episodes
from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.endpoints import qos
from serd_ros.endpoints.world.worlds import FIX
from support.waiting import PATIENCE_S, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
SERD = str(Path(sys.executable).with_name("serd"))


@pytest.fixture
def simulator(nodes, ros_env):
    """Starts a simulator in real time, with arguments."""

    def start(name, *arguments):
        command = node_command("hallway_sim", {"people": 0}, {}, ros_env)
        return nodes.start([*command, *arguments], name)

    return start


@pytest.mark.parametrize("paused", [False, True])
def test_a_second_simulator_ends_before_its_world_begins_and_names_both(
    paused, nodes, probe, simulator
):
    first = simulator("first")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("first"))
    if paused:
        pause = probe.node.create_client(SetBool, "pause")
        probe.spin_until(pause.service_is_ready)
        probe.spin_until(pause.call_async(SetBool.Request(data=True)).done)
    assert simulator("second", "-r", "__ns:=/other").wait(PATIENCE_S) == 2
    sentence = "there must be one publisher of /clock, got 2: /hallway_sim, /other/hallway_sim; "
    assert nodes.log_of("second").splitlines()[-1] == f"hallway_sim: {sentence}{FIX}"
    assert "commands come from" not in nodes.log_of("second")
    assert first.poll() is None


def test_a_simulator_ends_when_another_clock_runs_beside_its_own(nodes, probe, simulator):
    running = simulator("running")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("running"))
    clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
    probe.spin_until(lambda: "got 2: /hallway_sim, /probe" in nodes.log_of("running"))
    assert running.poll() is None  # nothing has been published yet
    probe.spin_until(lambda: clock.publish(Clock()) or running.poll() is not None)
    assert running.wait() == 2
    assert "/hallway_sim, /probe; " + FIX in nodes.log_of("running").splitlines()[-1]


def test_an_episode_beside_another_clock_does_not_count(nodes, probe, tmp_path):
    marks, reported = [], []
    probe.node.create_subscription(
        DiagnosticArray, "episode", lambda m: marks.append(from_episode_message(m)), qos.STATE
    )
    probe.node.create_subscription(
        DiagnosticArray, "diagnostics",
        lambda m: reported.extend(e for e in m.status if e.name == "hallway_sim: clock"), qos.STATE,
    )  # fmt: skip
    given = {"output": str(tmp_path / "bag")}
    stack = nodes.start_stack(
        "demonstrate",
        seed=3,
        episodes=1,
        timeout_s=20.0,
        demo_recorder__output=given["output"],
        scripted_expert__output=str(tmp_path),
    )
    probe.spin_until(lambda: marks)
    clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
    sentence = "the episode is discarded"
    probe.spin_until(
        lambda: sentence in nodes.log_of("scripted_expert") or stack["scripted_expert"].poll() == 0
    )
    assert "got 2: /hallway_sim, /probe; " + FIX in nodes.log_of("scripted_expert")
    probe.spin_until(lambda: reported and "/hallway_sim, /probe" in reported[-1].message)
    probe.node.destroy_publisher(clock)
    probe.spin_until(lambda: stack["scripted_expert"].poll() is not None)
    assert stack["scripted_expert"].wait() == 0
    probe.spin_until(lambda: len([each for each in marks if each.event == END]) == 2)
    assert [each.outcome for each in marks if each.event == END] == ["discarded", "timeout"]
    assert len(load_episodes(tmp_path / "episodes.csv")) == 1


def test_a_simulator_begins_after_another_one_was_killed(nodes, simulator):
    first = simulator("first")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("first"))
    first.kill()
    second = simulator("second")
    wait_until(lambda: "commands come from /cmd_vel" in nodes.log_of("second"))
    assert second.poll() is None


@pytest.mark.parametrize("words", [["launch", "live"], ["teleop"]])
def test_a_stack_with_a_simulator_does_not_start_beside_a_publisher_of_poses(
    probe, ros_env, words, tmp_path
):
    probe.node.create_publisher(PoseStamped, "robot_pose", qos.STATE)
    done = subprocess.run(
        [SERD, *words],
        cwd=tmp_path,
        env=ros_env,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 2
    assert (
        f"/robot_pose must have no publisher in ROS domain {ros_env['ROS_DOMAIN_ID']} before a"
        f" simulator starts, got /probe; {FIX}"
    ) in " ".join(done.stderr.split())


def test_a_start_waits_until_another_publisher_has_gone(probe, ros_env):
    """The middleware names a killed process for a while."""
    words = [sys.executable, "-m", "serd_ros.process.domain_check", "/clock"]
    clock = probe.node.create_publisher(Clock, "/clock", qos.CLOCK)
    check = subprocess.Popen(words, env=ros_env)
    try:
        # Both participants of the check are here once their publishers are.
        wait_until(lambda: probe.node.count_publishers("serd_start_check_1"))
        assert check.poll() is None
        probe.node.destroy_publisher(clock)
        assert check.wait(PATIENCE_S) == 0
    finally:
        check.kill()
        check.wait()
