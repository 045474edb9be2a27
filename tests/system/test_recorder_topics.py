"""The recorder on another robot: any topic, as its publishers offer it."""

import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import String

from serd_bag.formats.rosbag2.qos import profile_to_offer
from serd_bag.reader import BagReader
from serd_cli.processes.node_commands import find_command, node_command
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
    assert [each.topic for each in found] == ["/base/name", *["/base/imu"] * 20]
    times_s = [each.log_time_ns * 1e-9 for each in found]
    assert times_s == sorted(times_s)  # those of receipt
    assert started_s < times_s[0]
    assert times_s[-1] < time.time()
    assert found[0].type_name == "std_msgs/msg/String"
    infos = bag().topics
    assert set(infos) == {"/base/imu", "/base/name"}
    assert profile_to_offer(infos["/base/imu"].qos).reliability == "best_effort"
    assert profile_to_offer(infos["/base/name"].qos).durability == "transient_local"
    assert "21 messages" in nodes.log_of("demo_recorder")
    assert "/none has no publisher" in nodes.log_of("demo_recorder")


#: Stamps of a faulty sensor: seconds after the present, and from one message to the next.
STAMPS = {"an hour ahead": (3600, 0), "backwards": (0, -100), "zero or before": (-(10**10), 0)}


@pytest.mark.parametrize("fault", STAMPS)
def test_log_time_is_the_time_of_receipt_whatever_the_stamps_are(fault, record, probe, bag):
    process = record("odom", "cmd_vel")
    odometry = probe.node.create_publisher(Odometry, "odom", qos.STATE)
    commands = probe.node.create_publisher(Twist, "cmd_vel", qos.STATE)
    probe.spin_until(matched(odometry))
    probe.spin_until(matched(commands))
    sent: dict[str, list[tuple[int, int]]] = {"/odom": [], "/cmd_vel": []}
    for number in range(20):
        message = Odometry()
        ahead_s, step_s = STAMPS[fault]
        message.header.stamp.sec = max(int(time.time()) + ahead_s + step_s * number, -number)
        for name, publisher, data in (
            ("/odom", odometry, message),
            ("/cmd_vel", commands, Twist()),
        ):
            before_ns = time.time_ns()
            publisher.publish(data)
            assert publisher.wait_for_all_acked(Duration(seconds=PATIENCE_S))
            sent[name].append((before_ns, time.time_ns()))
    assert ended(process) == 0
    found = list(bag().messages())
    assert [each.topic for each in found] == ["/odom", "/cmd_vel"] * 20
    for name, spans_ns in sent.items():
        times = [(each.publish_time_ns, each.log_time_ns) for each in found if each.topic == name]
        for (published_ns, log_ns), (before_ns, after_ns) in zip(times, spans_ns, strict=True):
            assert before_ns <= published_ns <= log_ns <= after_ns


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
