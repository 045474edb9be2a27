"""A bag played into topics: each message arrives unchanged, and a pause stops it."""

import subprocess
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from serd_app.demonstrations.decision_table import save_decisions
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_app.learning.learning_files import read_learning_files
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_ros.convert.diagnostics import values_of
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.waiting import PATIENCE_S


@pytest.fixture(scope="module")
def bag(root: Path) -> Path:
    return sorted(path.parent for path in (root / "bags/data").rglob("metadata.yaml"))[0]


@pytest.fixture
def replay(nodes, ros_env, bag):
    def start(**parameters):
        command = node_command("bag_replay", {"bag": str(bag), **parameters}, {}, ros_env)
        return nodes.start(command, "bag_replay")

    return start


def table_without_source(path: Path) -> list[str]:
    return [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]


def test_a_learner_gets_from_a_replay_the_decisions_of_the_file(nodes, probe, bag, tmp_path):
    hallway = load_scenario("hallway")
    offline, _ = demonstrations_of_bag(bag, grid_of(hallway), hallway.patience_s, hallway.wait_s)
    save_decisions(tmp_path / "offline.csv", offline.decisions)
    received = tmp_path / "received.csv"
    started = nodes.start_stack(
        "replay_and_learn",
        bag=str(bag),
        bag_replay__rate=500.0,
        learner__output=str(tmp_path / "model.yaml"),
        learner__decisions=str(received),
    )
    wanted = table_without_source(tmp_path / "offline.csv")
    probe.spin_until(
        lambda: received.exists() and len(table_without_source(received)) == len(wanted)
    )
    assert table_without_source(received) == wanted
    learner = started["learner"]
    probe.spin_until(lambda: learner.poll() is not None)
    assert learner.returncode == 0
    assert (tmp_path / "model.yaml").exists()
    # What `serd learn` reads of the table is beside it.
    files = read_learning_files(received, discount=0.9)
    assert files.scenario == hallway


def test_every_recorded_pose_arrives_bit_for_bit_at_a_high_rate(probe, replay, bag):
    recorded = [each.data for each in BagReader(bag).messages({"/robot_pose"})]
    received: list[bytes] = []
    probe.node.create_subscription(
        PoseStamped, "robot_pose", received.append, qos.LOSSLESS, raw=True
    )
    ended = replay(rate=1000.0, topics=["robot_pose"], required_nodes=["probe"])
    probe.spin_until(lambda: len(received) == len(recorded))
    assert received == recorded
    probe.spin_until(lambda: ended.poll() is not None)
    assert ended.returncode == 0


def test_a_pause_stops_bag_time_and_messages(probe, replay):
    clocks: list[float] = []
    poses: list[bytes] = []
    reports: list[tuple[str, int]] = []

    def take_report(message):
        values = values_of(message, "bag_replay")
        if values is not None:
            reports.append((message.status[0].message, int(values["messages"])))

    create = probe.node.create_subscription
    create(Clock, "/clock", lambda message: clocks.append(stamp_s(message.clock)), qos.CLOCK)
    create(PoseStamped, "robot_pose", poses.append, qos.STATE, raw=True)
    create(DiagnosticArray, "diagnostics", take_report, qos.STATE)
    replay(rate=5.0, topics=["robot_pose"], required_nodes=["probe"])
    client = probe.node.create_client(SetBool, "pause")
    probe.spin_until(lambda: len(poses) > 20 and len(clocks) > 5)
    answer = client.call_async(SetBool.Request(data=True))
    probe.spin_until(answer.done)
    assert answer.result().message == "paused"
    probe.spin_until(lambda: reports and reports[-1][0] == "paused")
    n_sent = reports[-1][1]
    # Topics have no common order: a time from before the pause may come after the report.
    probe.spin_until(lambda: len(poses) == n_sent and clocks[-1] == clocks[-2])
    n_reports, n_clocks, stopped_at_s = len(reports), len(clocks), clocks[-1]
    probe.spin_until(lambda: len(reports) > n_reports + 1 and len(clocks) > n_clocks + 20)
    assert len(poses) == n_sent
    assert {n_messages for _, n_messages in reports[n_reports:]} == {n_sent}
    assert set(clocks[n_clocks:]) == {stopped_at_s}
    client.call_async(SetBool.Request(data=False))
    probe.spin_until(lambda: len(poses) > n_sent and clocks[-1] > stopped_at_s)
    assert clocks == sorted(clocks)


def test_a_damaged_bag_ends_the_replay_with_the_way_to_repair_it(
    nodes, probe, ros_env, bag, tmp_path
):
    broken = tmp_path / "broken"
    broken.mkdir()
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    for tenth in (4, 5, 6):  # at least one of them is in the data of a chunk
        place = len(content) * tenth // 10
        content[place : place + 64] = bytes(64)
    (broken / file.name).write_bytes(content)
    (broken / "metadata.yaml").write_bytes((bag / "metadata.yaml").read_bytes())
    sound = list(BagReader(broken, tolerant=True).messages({"/robot_pose"}))
    start_s = (sound[-500].log_time_ns - sound[0].log_time_ns) / 1e9
    received: list[bytes] = []
    probe.node.create_subscription(
        PoseStamped, "robot_pose", received.append, qos.LOSSLESS, raw=True
    )
    given = {"bag": str(broken), "rate": 1000.0, "topics": ["robot_pose"], "start_s": start_s}
    given["required_nodes"] = ["probe"]
    ended = nodes.start(node_command("bag_replay", given, {}, ros_env), "bag_replay")
    probe.spin_until(lambda: ended.poll() is not None)
    assert ended.returncode == 2
    log = nodes.log_of("bag_replay")
    assert "serd bag recover" in log
    assert "Exception" not in log
    assert "File " not in log
    probe.spin_until(lambda: len(received) >= 500)
    assert received == [each.data for each in sound[-500:]]


def test_an_empty_part_of_a_bag_is_rejected_before_playing(ros_env, bag):
    command = node_command("bag_replay", {"bag": str(bag), "start_s": 99999.0}, {}, ros_env)
    ended = subprocess.run(command, env=ros_env, capture_output=True, text=True, timeout=PATIENCE_S)
    assert ended.returncode == 2
    assert "must hold a message to play, got none from 99999 s on" in ended.stderr
