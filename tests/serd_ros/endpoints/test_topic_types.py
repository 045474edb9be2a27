"""Topics of the stack by name, any other with its type."""

import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from serd_files.errors import USER_ERRORS
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import named_topic, topic_type
from serd_ros.graph.graph import load_graph


def named(text):
    return named_topic(text, stamped_cmd_vel=False)


def test_every_topic_of_the_graph_has_a_type_that_can_be_imported():
    nodes = load_graph().nodes.values()
    published = {topic for node in nodes for topic in node.publishes}
    for topic in published:
        assert topic_type(topic, stamped_cmd_vel=False).message is not None, topic


def test_a_topic_of_the_stack_has_its_quality_of_service_and_any_other_follows_its_publishers():
    name, kind = named("odom")
    assert (name, kind.message, kind.qos) == ("odom", Odometry, qos.STATE)
    name, kind = named("/base/imu:sensor_msgs/msg/Imu")
    assert (name, kind.message, kind.qos) == ("/base/imu", Imu, None)


@pytest.mark.parametrize(
    ("text", "stamped"),
    [
        ("/clock", True),
        ("odom", True),
        ("cmd_vel", False),
        ("arrival", False),
        ("a:std_msgs/msg/Header", True),
        ("a:builtin_interfaces/msg/Time", False),
        ("a:std_msgs/msg/Empty", False),
        ("a:geometry_msgs/msg/Transform", False),
        ("a:geometry_msgs/msg/TransformStamped", True),
    ],
)
def test_a_message_is_stamped_where_its_first_field_is_a_header_or_a_time(text, stamped):
    assert named(text)[1].stamped == stamped


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("odmo", r"written topic:package/msg/Type, got 'odmo'; did you mean 'odom'\?"),
        ("/imu:sensor_msgs/Imu", "must be written package/msg/Type, got 'sensor_msgs/Imu'"),
        ("/imu:sensor_msgs/msg/Imuu", r"did you mean 'sensor_msgs/msg/Imu'\?"),
        ("/bumper:kobuki_ros_interfaces/msg/BumperEvent", "is not installed; install"),
        ("/imu:", "must be written package/msg/Type, got ''"),
        ("/im u:sensor_msgs/msg/Imu", "'/im u' must be a topic name"),
        (":sensor_msgs/msg/Imu", "'' must be a topic name"),
    ],
)
def test_what_cannot_be_recorded_is_refused_in_one_sentence(text, sentence):
    with pytest.raises(USER_ERRORS, match=sentence) as refused:
        assert named(text)[1].message
    assert "\n" not in str(refused.value)
