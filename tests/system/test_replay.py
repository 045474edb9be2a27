"""A bag played into topics: nothing is lost, nothing is changed, and it stops when asked."""

import subprocess
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from bags.reader import BagReader
from serd_app.demonstrations.decision_table import save_decisions
from serd_app.demonstrations.demonstrations import demonstrations_of_bag
from serd_cli.node_commands import node_command
from serd_ros.endpoints import qos
from sim.scenario.grid import grid_of
from sim.scenario.scenario import load_scenario


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


def test_a_learner_hears_in_a_replay_what_the_file_holds(nodes, probe, bag, tmp_path):
    hallway = load_scenario("hallway")
    offline, _ = demonstrations_of_bag(bag, grid_of(hallway), hallway.decision_period_s)
    save_decisions(tmp_path / "offline.csv", offline.decisions)
    heard = tmp_path / "heard.csv"
    nodes.start_stack(
        "replay_and_learn",
        bag=str(bag),
        bag_replay__rate=500.0,
        learner__output=str(tmp_path / "model.yaml"),
        learner__decisions=str(heard),
    )
    wanted = table_without_source(tmp_path / "offline.csv")
    probe.spin_until(lambda: heard.exists() and len(table_without_source(heard)) == len(wanted), 60)
    assert table_without_source(heard) == wanted


def test_every_recorded_pose_arrives_bit_for_bit_at_many_times_the_pace(probe, replay, bag):
    recorded = [each.data for each in BagReader(bag).messages({"/robot_pose"})]
    heard: list[bytes] = []
    probe.node.create_subscription(PoseStamped, "robot_pose", heard.append, qos.LOSSLESS, raw=True)
    ended = replay(rate=1000.0, topics=["robot_pose"], required_nodes=["probe"])
    probe.spin_until(lambda: len(heard) == len(recorded), 60)
    assert heard == recorded
    probe.spin_until(lambda: ended.poll() is not None)
    assert ended.returncode == 0


def test_a_pause_stops_bag_time_and_messages(probe, replay):
    clocks: list[float] = []
    heard: list[bytes] = []
    probe.node.create_subscription(
        Clock, "/clock", lambda m: clocks.append(m.clock.sec + 1e-9 * m.clock.nanosec), qos.CLOCK
    )
    probe.node.create_subscription(PoseStamped, "robot_pose", heard.append, qos.STATE, raw=True)
    replay(rate=5.0, required_nodes=["probe"])
    client = probe.node.create_client(SetBool, "pause")
    probe.spin_until(lambda: len(heard) > 20 and len(clocks) > 5)
    answer = client.call_async(SetBool.Request(data=True))
    probe.spin_until(answer.done)
    assert answer.result().message == "paused"
    probe.spin_for(0.5)
    count, stood_at_s = len(heard), clocks[-1]
    probe.spin_for(1.0)
    assert (len(heard), clocks[-1]) == (count, stood_at_s)
    client.call_async(SetBool.Request(data=False))
    probe.spin_until(lambda: len(heard) > count and clocks[-1] > stood_at_s)
    assert clocks == sorted(clocks)


def test_a_damaged_bag_ends_the_replay_with_the_way_to_repair_it(
    nodes, probe, ros_env, bag, tmp_path
):
    broken = tmp_path / "broken"
    broken.mkdir()
    file = next(bag.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 64] = bytes(64)
    (broken / file.name).write_bytes(content)
    (broken / "metadata.yaml").write_bytes((bag / "metadata.yaml").read_bytes())
    sound = list(BagReader(broken, tolerant=True).messages({"/robot_pose"}))
    start_s = (sound[-500].log_time_ns - sound[0].log_time_ns) / 1e9
    heard: list[bytes] = []
    probe.node.create_subscription(PoseStamped, "robot_pose", heard.append, qos.LOSSLESS, raw=True)
    given = {"bag": str(broken), "rate": 1000.0, "topics": ["robot_pose"], "start_s": start_s}
    given["required_nodes"] = ["probe"]
    ended = nodes.start(node_command("bag_replay", given, {}, ros_env), "bag_replay")
    probe.spin_until(lambda: ended.poll() is not None)
    assert ended.returncode == 2
    said = nodes.said("bag_replay")
    assert "serd bag recover" in said
    assert "Exception" not in said
    assert "File " not in said
    probe.spin_until(lambda: len(heard) >= 500)
    assert heard == [each.data for each in sound[-500:]]


def test_a_part_of_a_bag_that_holds_nothing_is_refused_at_once(ros_env, bag):
    command = node_command("bag_replay", {"bag": str(bag), "start_s": 99999.0}, {}, ros_env)
    ended = subprocess.run(command, env=ros_env, capture_output=True, text=True, timeout=30)
    assert ended.returncode == 2
    assert "must hold a message to play, got none from 99999 s on" in ended.stderr
