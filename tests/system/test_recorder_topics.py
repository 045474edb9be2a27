"""The recorder on another robot: any topic, as its publishers offer it."""

import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Header, String

from bags.reader import BagReader
from bags.rosbag2.qos import profile_to_offer
from serd_cli.executables import find_command
from serd_cli.node_commands import node_command
from serd_ros.convert.diagnostics import WARN
from serd_ros.convert.stamp import to_stamp
from serd_ros.endpoints import qos
from support.waiting import PATIENCE_S

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
    return process.wait(PATIENCE_S)


def matched(publisher):
    return lambda: publisher.get_subscription_count() > 0


def test_topics_of_another_robot_are_recorded_with_what_their_publishers_offer(
    record, probe, recorder_report, bag, nodes
):
    started_s = time.time()
    names = probe.node.create_publisher(String, "/base/name", qos.LATCHED)
    names.publish(String(data="published before the recorder started"))
    process = record(IMU, NAME, "/none:std_msgs/msg/String")
    imus = probe.node.create_publisher(Imu, "/base/imu", qos.SENSOR)  # comes later
    probe.spin_until(matched(imus))
    probe.spin_until(matched(names))
    probe.spin_until(lambda: recorder_report.n_messages == 1)
    for number in range(1, 21):
        message = Imu()
        message.header.stamp = to_stamp(0.1 * number)
        imus.publish(message)
    probe.spin_until(lambda: recorder_report.n_messages == 21)
    assert ended(process) == 0
    found = list(bag().messages())
    times_s = [each.log_time_ns * 1e-9 for each in found if each.topic == "/base/imu"]
    assert times_s == pytest.approx([0.1 * n for n in range(1, 21)])
    (name,) = [each for each in found if each.topic == "/base/name"]
    assert name.type_name == "std_msgs/msg/String"
    assert started_s < name.log_time_ns * 1e-9 < time.time()  # without /clock, the system's time
    infos = bag().topics
    assert set(infos) == {"/base/imu", "/base/name"}
    assert profile_to_offer(infos["/base/imu"].qos).reliability == "best_effort"
    assert profile_to_offer(infos["/base/name"].qos).durability == "transient_local"
    assert "21 messages" in nodes.log_of("demo_recorder")
    assert "/none has no publisher" in nodes.log_of("demo_recorder")


def test_a_topic_of_the_stack_is_recorded_also_from_a_publisher_that_offers_less(
    record, probe, recorder_report, bag
):
    process = record("odom")
    odometry = probe.node.create_publisher(Odometry, "odom", qos.SENSOR)

    def publish(time_s):
        odometry.publish(Odometry(header=Header(stamp=to_stamp(time_s))))

    def first_is_recorded():
        publish(0.05)  # best effort: lost until the recorder has matched the publisher
        return recorder_report.n_messages > 0

    probe.spin_until(first_is_recorded)
    for number in range(1, 11):
        publish(0.1 * number)
    probe.spin_until(lambda: recorder_report.time_s == pytest.approx(1.0))
    assert ended(process) == 0
    times_s = [message.log_time_ns * 1e-9 for message in bag().messages()]
    assert times_s[-10:] == pytest.approx([0.1 * number for number in range(1, 11)])


def test_recording_goes_on_when_a_second_publisher_offers_less(record, probe, recorder_report, bag):
    process = record(NAME)
    latched = probe.node.create_publisher(String, "/base/name", qos.LATCHED)
    latched.publish(String(data="first"))
    probe.spin_until(lambda: recorder_report.n_messages == 1)
    weak = QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )
    best_effort = probe.node.create_publisher(String, "/base/name", weak)
    probe.spin_until(matched(best_effort))
    probe.spin_until(matched(latched))
    best_effort.publish(String(data="second"))
    latched.publish(String(data="third"))
    probe.spin_until(lambda: recorder_report.n_messages == 3)
    assert ended(process) == 0
    recorded = [each.data for each in bag().messages()]
    assert len(recorded) == 3
    assert b"first" in recorded[0]
    assert {b"second" in data or b"third" in data for data in recorded[1:]} == {True}


def test_a_topic_of_another_type_than_given_is_reported_while_the_node_records(
    record, probe, nodes
):
    warnings = []

    def take(message):
        warnings.extend(each.message for each in message.status if each.level == WARN)

    probe.node.create_subscription(DiagnosticArray, "diagnostics", take, qos.STATE)
    process = record("/base/imu:std_msgs/msg/String")
    probe.node.create_publisher(Imu, "/base/imu", qos.SENSOR)
    sentence = "/base/imu is sensor_msgs/msg/Imu, not std_msgs/msg/String"
    probe.spin_until(lambda: sentence in warnings)
    assert ended(process) == 0
    assert sentence in nodes.log_of("demo_recorder")


def test_a_list_of_topics_is_written_on_the_command_line_with_quotes(
    nodes, probe, ros_env, tmp_path
):
    command = find_command("serd_ros", "demo_recorder", ros_env)
    topics = f"topics:=[odom, '{IMU}']"
    arguments = ["-p", topics, "-p", f"output:={tmp_path / 'bag'}"]
    process = nodes.start([*command, "--ros-args", *arguments], "demo_recorder")
    imus = probe.node.create_publisher(Imu, "/base/imu", qos.STATE)
    probe.spin_until(matched(imus))
    assert ended(process) == 0


def test_arguments_that_ros_cannot_read_are_refused_in_one_sentence(nodes, ros_env):
    command = find_command("serd_ros", "demo_recorder", ros_env)
    arguments = ["--ros-args", "-p", f"topics:=[odom, {IMU}]"]
    process = nodes.start([*command, *arguments], "demo_recorder")
    assert process.wait(PATIENCE_S) == 2
    log = nodes.log_of("demo_recorder")
    assert f"topics:=[odom, {IMU}]" in log
    assert "put a value that contains : into quotes" in log
    assert "Traceback" not in log


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
    assert process.wait(PATIENCE_S) == 2
    assert sentence in nodes.log_of("demo_recorder")
    assert "Traceback" not in nodes.log_of("demo_recorder")
    assert not (tmp_path / "bag").exists()
