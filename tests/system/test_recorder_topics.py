"""The recorder on a robot that is not ours: any topic, as its publishers offer it."""

import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import String

from bags.reader import BagReader
from bags.rosbag2.qos import qos_of_yaml
from serd_cli.executables import find_command
from serd_cli.node_commands import node_command
from serd_ros.convert.diagnostics import WARN
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos

pytestmark = [pytest.mark.ros, pytest.mark.slow]
IMU = "/base/imu:sensor_msgs/msg/Imu"
NAME = "/base/name:std_msgs/msg/String"


@pytest.fixture
def record(nodes, probe, ros_env, tmp_path):
    """Starts a recorder of the given topics."""

    def start(*topics):
        given = {"output": str(tmp_path / "bag"), "topics": topics, "minimum_free_mb": 0.0}
        process = nodes.start(node_command("demo_recorder", given, {}, ros_env), "demo_recorder")
        probe.spin_until((tmp_path / "bag" / "bag_0.mcap").exists)
        return process

    return start


@pytest.fixture
def bag(tmp_path):
    return lambda: BagReader(tmp_path / "bag")


def ended(process):
    process.send_signal(signal.SIGTERM)
    return process.wait(15)


def listened_to(publisher):
    return lambda: publisher.get_subscription_count() > 0


def test_topics_of_another_robot_are_recorded_with_what_their_publishers_offer(
    record, probe, bag, nodes
):
    names = probe.node.create_publisher(String, "/base/name", qos.LATCHED)
    names.publish(String(data="said before anybody listened"))
    process = record(IMU, NAME, "/none:std_msgs/msg/String")
    imus = probe.node.create_publisher(Imu, "/base/imu", qos.SENSOR)  # comes later
    probe.spin_until(listened_to(imus))
    probe.spin_until(listened_to(names))
    probe.spin_for(0.5)
    for number in range(1, 21):
        message = Imu()
        message.header.stamp = to_stamp(0.1 * number)
        imus.publish(message)
        probe.spin_for(0.02)
    assert ended(process) == 0
    found = list(bag().messages())
    times_s = [each.log_time_ns * 1e-9 for each in found if each.topic == "/base/imu"]
    assert times_s == pytest.approx([0.1 * n for n in range(1, 21)])
    (name,) = [each for each in found if each.topic == "/base/name"]
    assert name.type_name == "std_msgs/msg/String"
    assert abs(name.log_time_ns * 1e-9 - time.time()) < 60.0  # no /clock: the system's
    infos = bag().topics
    assert set(infos) == {"/base/imu", "/base/name"}
    assert qos_of_yaml(infos["/base/imu"].qos).reliability == "best_effort"
    assert qos_of_yaml(infos["/base/name"].qos).durability == "transient_local"
    assert "21 messages" in nodes.said("demo_recorder")
    assert "/none has no publisher" in nodes.said("demo_recorder")


def test_a_topic_of_the_stack_is_heard_also_from_a_publisher_that_offers_less(record, probe, bag):
    process = record("odom")
    odometry = probe.node.create_publisher(Odometry, "odom", qos.SENSOR)
    probe.spin_until(listened_to(odometry))
    probe.spin_for(0.3)
    for number in range(1, 11):
        message = Odometry()
        message.header.stamp = to_stamp(0.1 * number)
        odometry.publish(message)
        probe.spin_for(0.02)
    assert ended(process) == 0
    assert len(list(bag().messages())) == 10


def test_messages_go_on_when_a_second_publisher_offers_less(record, probe, bag):
    process = record(NAME)
    latched = probe.node.create_publisher(String, "/base/name", qos.LATCHED)
    probe.spin_until(listened_to(latched))
    probe.spin_for(0.3)
    latched.publish(String(data="first"))
    probe.spin_for(0.3)
    weak = QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )
    hasty = probe.node.create_publisher(String, "/base/name", weak)
    probe.spin_until(listened_to(hasty))
    probe.spin_until(listened_to(latched))
    probe.spin_for(0.5)
    hasty.publish(String(data="second"))
    latched.publish(String(data="third"))
    probe.spin_for(0.5)
    assert ended(process) == 0
    said = [each.data for each in bag().messages()]
    assert len(said) == 3
    assert b"first" in said[0]
    assert {b"second" in data or b"third" in data for data in said[1:]} == {True}


def test_a_topic_of_another_type_than_given_is_told_while_it_records(record, probe, nodes):
    told = []

    def hear(message):
        told.extend(each.message for each in message.status if each.level == WARN)

    probe.node.create_subscription(DiagnosticArray, "diagnostics", hear, qos.STATE)
    process = record("/base/imu:std_msgs/msg/String")
    probe.node.create_publisher(Imu, "/base/imu", qos.SENSOR)
    sentence = "/base/imu is sensor_msgs/msg/Imu, not std_msgs/msg/String"
    probe.spin_until(lambda: sentence in told)
    assert ended(process) == 0
    assert sentence in nodes.said("demo_recorder")


def test_a_list_of_topics_is_written_on_the_command_line_with_quotes(
    nodes, probe, ros_env, tmp_path
):
    command = find_command("serd_ros", "demo_recorder", ros_env)
    topics = f"topics:=[odom, '{IMU}']"
    arguments = ["-p", topics, "-p", f"output:={tmp_path / 'bag'}"]
    process = nodes.start([*command, "--ros-args", *arguments], "demo_recorder")
    imus = probe.node.create_publisher(Imu, "/base/imu", qos.STATE)
    probe.spin_until(listened_to(imus))
    assert ended(process) == 0


def test_arguments_that_ros_cannot_read_are_refused_in_one_sentence(nodes, ros_env):
    command = find_command("serd_ros", "demo_recorder", ros_env)
    arguments = ["--ros-args", "-p", f"topics:=[odom, {IMU}]"]
    process = nodes.start([*command, *arguments], "demo_recorder")
    assert process.wait(20) == 2
    said = nodes.said("demo_recorder")
    assert f"topics:=[odom, {IMU}]" in said
    assert "put a value that holds : into quotes" in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("topics", "sentence"),
    [
        (("odom", "/odom:nav_msgs/msg/Odometry"), "each topic once, got /odom twice"),
        (("/base/imu:sensor_msgs/msg/Imuu",), "did you mean 'sensor_msgs/msg/Imu'?"),
        (("/base/imu",), "written topic:package/msg/Type, got '/base/imu'"),
    ],
)
def test_topics_that_cannot_be_recorded_are_refused_at_once(
    nodes, ros_env, tmp_path, topics, sentence
):
    given = {"output": str(tmp_path / "bag"), "topics": topics}
    process = nodes.start(node_command("demo_recorder", given, {}, ros_env), "demo_recorder")
    assert process.wait(20) == 2
    assert sentence in nodes.said("demo_recorder")
    assert "Traceback" not in nodes.said("demo_recorder")
    assert not (tmp_path / "bag").exists()
