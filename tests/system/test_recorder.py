"""The recorder as a process: every message it has received is in the bag, whatever ends it."""

import math
import shlex
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import String

from serd_app.demonstrations.decision_table import save_decisions
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.journeys.demonstrate import PlaceChoice, demonstrate
from serd_app.learning.checkpoint import CheckpointFolder
from serd_app.learning.learning_files import read_learning_files
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.formats.rosbag2.qos import profile_to_offer
from serd_bag.messages.plain import message_stamp_ns
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from serd_bag.writer import BagWriter
from serd_cli.processes.workspace import find_command, node_command
from serd_files.model_file import ModelFile, load_model
from serd_files.yaml_config import yaml_model
from serd_ros.convert.diagnostics import ERROR, WARN
from serd_ros.convert.stamp import stamp_ns, to_stamp
from serd_ros.endpoints import qos
from serd_sim.scenario.grid import grid_of
from serd_sim.scenario.scenario import load_scenario
from support.bag_messages import TF
from support.changed_scenario import changed_scenario
from support.damaged_files import counts_of
from support.foreign_bags import START_S, ForeignBag, Robot
from support.waiting import PATIENCE_S, ProcessorWait, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.slow]
IMU = "/base/imu:sensor_msgs/msg/Imu"
NAME = "/base/name:std_msgs/msg/String"


class Recording:
    """A recorder of some topics, and how it ends."""

    def __init__(self, nodes, probe, environment, folder, topics, largest_file_bytes=0):
        self.bag, self._probe = folder / "bag", probe
        given = {"output": str(self.bag), "topics": topics, "minimum_free_mb": 0.0}
        command = node_command("demo_recorder", given, {}, environment)
        if largest_file_bytes:
            limit = f"ulimit -f {largest_file_bytes // 1024}; exec {shlex.join(command)}"
            command = ["bash", "-c", limit]
        self.process = nodes.start(command, "demo_recorder")
        probe.spin_until((self.bag / "bag_0.mcap").exists)

    def publisher(self, kind, topic, profile=qos.STATE):
        """A publisher to which the recorder subscribes."""
        made = self._probe.node.create_publisher(kind, topic, profile)
        self._probe.spin_until(made.get_subscription_count)
        return made

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


@pytest.fixture
def record(nodes, probe, ros_env, tmp_path):
    return lambda *topics, **more: Recording(nodes, probe, ros_env, tmp_path, topics, **more)


def publish_pose(poses, time_s):
    message = PoseStamped()
    message.header.stamp = to_stamp(time_s)
    poses.publish(message)


def test_messages_received_before_a_signal_are_in_the_bag(record):
    """The process is stopped meanwhile, as on a machine that is too busy to run it."""
    recording = record("robot_pose", "/clock")
    poses = recording.publisher(PoseStamped, "robot_pose")
    file = recording.bag / "bag_0.mcap"
    empty = file.stat().st_size

    def is_heard():
        publish_pose(poses, 0.0)
        return file.stat().st_size > empty

    wait_until(is_heard)
    recording.process.send_signal(signal.SIGSTOP)
    sent_s = [0.1 * number for number in range(1, 201)]
    for time_s in sent_s:
        publish_pose(poses, time_s)
    recording.process.send_signal(signal.SIGTERM)
    recording.process.send_signal(signal.SIGCONT)
    assert recording.process.wait(PATIENCE_S) == 0
    recorded_s = [stamp_s(each) for each in BagReader(recording.bag).messages({"/robot_pose"})]
    assert [each for each in recorded_s if each > 0.0] == pytest.approx(sent_s)


def stamp_s(message):
    return message_stamp_ns(message.data) * 1e-9


def test_a_full_disk_is_reported_on_diagnostics_ends_the_node_and_keeps_the_bag(
    record, probe, nodes, tmp_path
):
    health = probe.health()
    recording = record("robot_pose", largest_file_bytes=40 * 1024)
    poses, time_s = recording.publisher(PoseStamped, "robot_pose"), 0.0

    def full():
        nonlocal time_s
        for _ in range(10):
            time_s += 0.1
            publish_pose(poses, time_s)
        return recording.process.poll() is not None

    probe.spin_until(full)
    assert recording.process.returncode == 2
    assert "cannot write" in nodes.log_of("demo_recorder")
    problems = lambda: [each.message for each in health if each.level == ERROR]  # noqa: E731
    probe.spin_until(problems)
    assert "cannot write" in problems()[0]
    n_kept = sum(1 for _ in BagReader(recording.bag, tolerant=True).messages({"/robot_pose"}))
    assert n_kept > 50
    assert counts_of(rescue(recording.bag, tmp_path / "recovered"))["/robot_pose"] == n_kept


def test_topics_of_another_robot_are_recorded_with_what_their_publishers_offer(
    record, probe, nodes
):
    started_s, health = time.time(), probe.health()

    def counts():
        pairs = (each for status in health for each in status.values)
        return [each.value for each in pairs if each.key == "messages"]

    names = probe.node.create_publisher(String, "/base/name", qos.LATCHED)
    names.publish(String(data="published before the recorder started"))
    recording = record(IMU, NAME, "/none:std_msgs/msg/String", "/base/odom:std_msgs/msg/String")
    imus = recording.publisher(Imu, "/base/imu", qos.SENSOR)  # comes later
    probe.spin_until(names.get_subscription_count)
    probe.node.create_publisher(Odometry, "/base/odom", qos.SENSOR)
    probe.spin_until(lambda: "1" in counts())
    for number in range(1, 21):
        message = Imu()
        message.header.stamp = to_stamp(0.1 * number)
        imus.publish(message)
    probe.spin_until(lambda: "21" in counts())
    sentence = "/base/odom is nav_msgs/msg/Odometry, not std_msgs/msg/String"
    probe.spin_until(lambda: any(sentence in each.message for each in health if each.level == WARN))
    assert recording.end() == 0
    reader = BagReader(recording.bag)
    found = list(reader.messages())
    assert [each.topic for each in found] == ["/base/name", *["/base/imu"] * 20]
    times_s = [each.log_time_ns * 1e-9 for each in found]
    assert times_s == sorted(times_s)  # those of receipt
    assert started_s < times_s[0]
    assert times_s[-1] < time.time()
    infos = reader.topics
    assert set(infos) == {"/base/imu", "/base/name"}
    assert profile_to_offer(infos["/base/imu"].qos).reliability == "best_effort"
    assert profile_to_offer(infos["/base/name"].qos).durability == "transient_local"
    log = nodes.log_of("demo_recorder")
    for words in ("21 messages", "/none has no publisher", sentence):
        assert words in log


def test_what_several_publishers_sent_and_the_way_lost_is_counted(record, probe):
    """The recorder does not empty its socket while it is stopped."""
    health = probe.health()
    recording = record("/text:std_msgs/msg/String")
    texts = [recording.publisher(String, "/text", qos.SENSOR) for _ in range(2)]
    n_sent = 0

    def send(n_bytes):
        nonlocal n_sent
        for each in texts:
            each.publish(String(data="x" * n_bytes))
            n_sent += 1

    def latest(name):
        values = {each.key: each.value for status in health[-1:] for each in status.values}
        return int(values.get(name, 0))

    def all_are_known():
        send(1)
        time.sleep(0.05)
        return latest("lost") and latest("messages") + latest("lost") >= n_sent - 100

    probe.spin_until(lambda: send(1) or latest("messages") > 10)
    recording.process.send_signal(signal.SIGSTOP)
    for _ in range(200):
        send(100_000)
    recording.process.send_signal(signal.SIGCONT)
    probe.spin_until(all_are_known)
    assert recording.end() == 0
    assert len(list(BagReader(recording.bag).messages())) + latest("lost") == n_sent


TOPICS = [f"/pose_{number}" for number in range(5)]
PERIOD_S, N_ROUNDS, MOST_LOST_S = 0.04, 40, 0.5


def test_a_killed_recorder_has_lost_the_last_half_second_of_a_topic_at_most(record, tmp_path):
    """On a busy machine messages wait for the recorder; as long as threads waited may be lost."""
    recording = record(*[f"{topic}:geometry_msgs/msg/PoseStamped" for topic in TOPICS])
    publishers = {topic: recording.publisher(PoseStamped, topic) for topic in TOPICS}
    wait, sent = ProcessorWait(), []  # of each round: stamp, time, waits for a processor so far
    for _ in range(N_ROUNDS):
        now_ns = time.time_ns()
        for publisher in publishers.values():
            publish_pose(publisher, now_ns * 1e-9)
        sent.append((stamp_ns(to_stamp(now_ns * 1e-9)), time.time_ns(), wait.total_s))
        time.sleep(PERIOD_S)
    assert recording.end(signal.SIGKILL) == -signal.SIGKILL
    killed_ns, waited_s = time.time_ns(), wait.total_s
    reader = BagReader(recording.bag, tolerant=True)
    recorded_ns = {topic: [] for topic in TOPICS}
    for message in reader.messages():
        recorded_ns[message.topic].append(message_stamp_ns(message.data))
    assert reader.damage  # the reader does not take the bag for complete
    for topic, stamps_ns in recorded_ns.items():
        assert stamps_ns == [stamp for stamp, _, _ in sent[: len(stamps_ns)]], topic
        if lost := sent[len(stamps_ns) :]:
            lost_s = (killed_ns - lost[0][1]) * 1e-9 - (waited_s - lost[0][2])
            assert lost_s <= MOST_LOST_S, topic
    counts = counts_of(rescue(recording.bag, tmp_path / "recovered"))
    assert counts == {topic: len(stamps_ns) for topic, stamps_ns in recorded_ns.items()}


def test_arguments_that_ros_cannot_read_are_refused_in_one_sentence(nodes, ros_env):
    command = find_command("serd_ros", "demo_recorder", ros_env)
    process = nodes.start([*command, "--ros-args", "-p", f"topics:=[odom, {IMU}]"], "demo_recorder")
    assert process.wait(PATIENCE_S) == 2
    log = nodes.log_of("demo_recorder")
    assert f"topics:=[odom, {IMU}]" in log
    assert "put a value that contains : into quotes" in log
    assert "Traceback" not in log


N_SENT = 50


def test_tf_is_played_from_one_bag_and_recorded_into_another(nodes, ros_env, tmp_path, messages):
    sent = [
        messages.transform(1.0 + 0.1 * n, "odom", "base_link", 0.1 * n, 0.0) for n in range(N_SENT)
    ]
    with BagWriter(tmp_path / "played") as writer:
        writer.add_topic("/tf", TF)
        for number, data in enumerate(sent):
            writer.write("/tf", data, 10**9 + number * 10**8)
    given = {"output": str(tmp_path / "bag"), "topics": ["tf"], "minimum_free_mb": 0.0}
    recorder = nodes.start(node_command("demo_recorder", given, {}, ros_env), "demo_recorder")
    wait_until((tmp_path / "bag" / "bag_0.mcap").exists)
    played = {"bag": str(tmp_path / "played"), "rate": 20.0}
    replay = nodes.start(node_command("bag_replay", played, {}, ros_env), "bag_replay")
    assert replay.wait(PATIENCE_S) == 0
    recorder.send_signal(signal.SIGTERM)
    assert recorder.wait(PATIENCE_S) == 0
    reader = BagReader(tmp_path / "bag")
    assert [each.data for each in reader.messages(["/tf"])] == sent
    assert reader.topics["/tf"].message_type == message_type(TF)


HALLWAY = load_scenario("hallway")


@pytest.fixture(scope="module")
def bag(root: Path) -> Path:
    return sorted(path.parent for path in (root / "bags/data").rglob("metadata.yaml"))[0]


def demonstrations(bag):
    return demonstrations_of_bag(bag, grid_of(HALLWAY), HALLWAY.patience_s, HALLWAY.wait_s)[0]


def table_without_source(path: Path) -> list[str]:
    return [line.rsplit(",", 1)[0] for line in path.read_text().splitlines()]


def test_a_learner_gets_from_a_replay_the_decisions_of_the_file(nodes, probe, bag, tmp_path):
    """The learner ends by itself, with a model of all of them."""
    save_decisions(tmp_path / "offline.csv", demonstrations(bag))
    received, model = tmp_path / "received.csv", tmp_path / "model.yaml"
    learner = nodes.start_stack(
        "replay_and_learn",
        bag=str(bag),
        bag_replay__rate=500.0,
        learner__output=str(model),
        learner__decisions=str(received),
    )["learner"]
    probe.spin_until(lambda: learner.poll() is not None)
    assert learner.returncode == 0
    wanted = table_without_source(tmp_path / "offline.csv")
    assert table_without_source(received) == wanted
    assert load_model(model).fit.n_decisions == len(wanted) - 1
    # What `serd learn` reads of the table is beside it.
    assert read_learning_files(received, discount=0.9).scenario == HALLWAY


MAPPING = """
pose_topic: tf
frame: map
robot_frame: base_link
action_from: velocity
action_topic: cmd_vel
hold_s: 0.5
stop_s: 5.0
"""


@pytest.fixture
def foreign_bag(messages, tmp_path):
    """Of a robot that drives north in the hallway three times, by Twists, with a pose by /tf."""
    found, commands = ForeignBag(messages), []
    for begin_s in (1.0, 26.0, 51.0):
        times_s = np.arange(begin_s, begin_s + 15.0, 0.1)
        commands += [(at_s, 0.45, 0.05 * math.sin(0.8 * at_s)) for at_s in times_s]
    time_s, x_m, y_m, yaw_rad, speed = Robot(hold_s=0.5).drive(commands, 75.0).T
    track = np.column_stack([time_s, 2.5 - y_m, 1.3 + x_m, yaw_rad + math.pi / 2, speed])
    found.add_tf("/tf", track, "odom", "base_link", every=4)
    for at_s in np.arange(0.0, 75.0, 0.5):
        data = messages.transform(START_S + at_s, "map", "odom", 0.01 * math.sin(at_s), 0.0, 0.0)
        found.add("/tf", TF, at_s + 0.002, data)
    found.add_commands("/cmd_vel", commands)
    return found.write(tmp_path / "laps")


def test_a_learner_of_another_robot_gets_the_decisions_of_serd_demos(
    nodes, probe, foreign_bag, tmp_path
):
    """Live, from topics that a mapping names: pose by /tf, commands without stamps, stops.

    The goal is smaller than its cell; what is decided there is no decision to learn from.
    """
    mapping, received = tmp_path / "mapping.yaml", tmp_path / "received.csv"
    mapping.write_text(MAPPING)
    goal, other = (
        "[[11, 16], [13, 16], [13, 20], [11, 20]]",
        "[[2.1, 7.4], [2.9, 7.4], [2.9, 8], [2.1, 8]]",
    )
    place = str(changed_scenario(tmp_path, "hallway", {goal: other}))
    offline, model = tmp_path / "offline.csv", tmp_path / "model.yaml"
    demonstrate([foreign_bag], offline, PlaceChoice(place), mapping=mapping)
    wanted = read_learning_files(offline, discount=0.9)
    assert wanted.n_after_goal > 0
    learner = nodes.start_stack(
        "replay_and_learn",
        bag=str(foreign_bag),
        scenario=place,
        mapping=str(mapping),
        bag_replay__rate=40.0,
        learner__output=str(model),
        learner__decisions=str(received),
        learner__minimum_decisions=10,
    )["learner"]
    probe.spin_until(lambda: learner.poll() is not None, seen=lambda: nodes.log_of("learner"))
    assert learner.returncode == 0, nodes.log_of("learner")
    assert table_without_source(received) == table_without_source(offline)
    assert load_model(model).fit.n_decisions == len(wanted.decisions)


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
