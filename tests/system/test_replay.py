"""A bag played into topics: each message arrives unchanged, of a damaged one the sound part."""

import signal
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String

from serd_app.demonstrations.decision_table import save_decisions
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.learning.checkpoint import CheckpointFolder
from serd_app.learning.learning_files import read_learning_files
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import node_command
from serd_files.model_file import ModelFile, load_model
from serd_files.yaml_config import yaml_model
from serd_ros.endpoints import qos
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario

HALLWAY = load_scenario("hallway")


@pytest.fixture(scope="module")
def bag(root: Path) -> Path:
    return sorted(path.parent for path in (root / "bags/data").rglob("metadata.yaml"))[0]


@pytest.fixture
def replay(nodes, ros_env, bag):
    def start(**parameters):
        command = node_command("bag_replay", {"bag": str(bag), **parameters}, {}, ros_env)
        return nodes.start(command, "bag_replay")

    return start


def demonstrations(bag):
    return demonstrations_of_bag(bag, grid_of(HALLWAY), HALLWAY.patience_s, HALLWAY.wait_s)[0]


def table_without_source(path: Path) -> list[str]:
    return [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]


def test_a_learner_gets_from_a_replay_the_decisions_of_the_file(nodes, probe, bag, tmp_path):
    save_decisions(tmp_path / "offline.csv", demonstrations(bag))
    received = tmp_path / "received.csv"
    learner = nodes.start_stack(
        "replay_and_learn",
        bag=str(bag),
        bag_replay__rate=500.0,
        learner__output=str(tmp_path / "model.yaml"),
        learner__decisions=str(received),
    )["learner"]
    wanted = table_without_source(tmp_path / "offline.csv")
    probe.spin_until(
        lambda: received.exists() and len(table_without_source(received)) == len(wanted)
    )
    assert table_without_source(received) == wanted
    probe.spin_until(lambda: learner.poll() is not None)
    assert learner.returncode == 0
    assert (tmp_path / "model.yaml").exists()
    # What `serd learn` reads of the table is beside it.
    assert read_learning_files(received, discount=0.9).scenario == HALLWAY


def test_a_learner_killed_in_a_long_fit_resumes_from_its_last_checkpoint(
    nodes, probe, bag, tmp_path
):
    decisions, models = demonstrations(bag), []
    probe.node.create_subscription(String, "model", models.append, qos.LATCHED)
    folder = CheckpointFolder(tmp_path / "kept", HALLWAY)
    folder.save_decisions(decisions)
    folder.save(folder.new())
    given = {"output": str(tmp_path / "model.yaml"), "state": str(folder.path)}
    given["prior_weights"] = [0.001 * number for number in range(1, 1000)]
    first = nodes.start_stack("learn", **given)["learner"]
    probe.spin_until(lambda: folder.load()[0].step > 0)
    first.send_signal(signal.SIGKILL)
    first.wait()
    assert folder.load()[0].n_learned == 0
    assert not models
    # The second compares no weights, so that it ends soon.
    nodes.start_stack("learn", **(given | {"prior_weights": [0.1]}))
    probe.spin_until(lambda: models)
    model = yaml_model(models[-1].data, ModelFile, name="model")
    assert model.fit.n_decisions == len(decisions)
    assert load_model(tmp_path / "model.yaml") == model
    probe.spin_until(lambda: folder.load()[0].n_learned == len(decisions))


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
