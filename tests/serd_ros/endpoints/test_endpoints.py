"""What a scope makes ends with it, and no callback of it runs afterwards."""

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import Header, Int32
from std_srvs.srv import Trigger

from serd_files.errors import USER_ERRORS
from serd_ros.endpoints import qos
from serd_ros.endpoints.topic_types import named_topic, topic_type
from serd_ros.graph.graph import load_graph
from support.nodes_in_process import deliver, node_in_process

KINDS = ("publishers", "subscriptions", "services", "clients", "timers")


def endpoints_of(node):
    return {kind: set(getattr(node, kind)) for kind in KINDS}


@pytest.fixture
def running():
    with node_in_process("teleop_mux", frame_prefix="robot1/") as found:
        yield found


def fill(endpoints, taken):
    """An endpoint of each kind; returns their callbacks as rclpy has them."""
    node = endpoints.node
    before = endpoints_of(node)
    endpoints.publisher(Int32, "sent", qos.STATE)
    endpoints.subscribe(Int32, "number", taken.append, qos.STATE)
    endpoints.subscribe_raw(Int32, "bytes", taken.append, qos.STATE)
    endpoints.every(60.0, lambda: taken.append("timer"))
    endpoints.serve(Trigger, "ask", lambda _: taken.append("asked") or "answer")
    endpoints.client(Trigger, "asked")
    return {kind: found - before[kind] for kind, found in endpoints_of(node).items()}


@pytest.mark.parametrize("depth", [0, 1])
def test_all_that_a_scope_made_ends_with_it_and_with_the_scope_around_it(running, depth):
    node, taken = running.node, []
    before = endpoints_of(node)
    outer = node.endpoints.scope()
    made = fill(outer.scope() if depth else outer, taken)
    assert [len(made[kind]) for kind in KINDS] == [1, 2, 1, 1, 1]
    node.endpoints.destroy(outer)
    assert endpoints_of(node) == before
    for subscription in made["subscriptions"]:
        deliver(subscription, Int32())
    for timer in made["timers"]:
        timer.callback()
    (service,) = made["services"]
    service.callback(Trigger.Request(), Trigger.Response())
    assert not taken


def test_a_service_answers_with_the_sentence_of_an_error(running):
    def refuse(_):
        raise USER_ERRORS[0]("no; do another thing")

    running.node.endpoints.serve(Trigger, "ask", refuse)
    response = running.call("ask", Trigger.Request())
    assert (response.success, response.message) == (False, "no; do another thing")


def test_frames_come_without_the_prefix_of_the_robot_also_with_info_from_either_executor(running):
    subscribe, taken = running.node.endpoints.subscribe, []

    def in_frame(frame):
        return PoseStamped(header=Header(frame_id=frame))

    subscribe(PoseStamped, "pose", lambda message: taken.append(message.header.frame_id), qos.STATE)
    for frame in ("robot1/odom", "map"):
        running.receive("pose", in_frame(frame))
    subscribe(
        PoseStamped, "other", lambda message, _: taken.append(message.header.frame_id), qos.STATE
    )
    (found,) = [each for each in running.node.subscriptions if each.topic_name == "/other"]
    found.callback(in_frame("robot1/base_link"), {})
    found.callback((in_frame("robot1/base_link"), {}))
    assert taken == ["odom", "map", "base_link", "base_link"]


def named(text):
    return named_topic(text, stamped_cmd_vel=False)


def test_every_topic_of_the_graph_has_a_type_that_can_be_imported():
    nodes = load_graph().nodes.values()
    published = {topic for node in nodes for topic in node.publishes}
    for topic in published:
        assert topic_type(topic, stamped_cmd_vel=False).message is not None, topic


def test_a_topic_of_the_stack_has_its_quality_of_service_and_any_other_follows_its_publishers():
    for text, expected in (
        ("odom", ("odom", Odometry, qos.STATE)),
        ("/base/imu:sensor_msgs/msg/Imu", ("/base/imu", Imu, None)),
    ):
        name, kind = named(text)
        assert (name, kind.message, kind.qos) == expected


@pytest.mark.parametrize(
    ("text", "stamped"),
    [
        ("/clock", True),
        ("cmd_vel", False),
        ("a:std_msgs/msg/Header", True),
        ("a:std_msgs/msg/Empty", False),
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
        ("/im u:sensor_msgs/msg/Imu", "'/im u' must be a topic name"),
        (":sensor_msgs/msg/Imu", "'' must be a topic name"),
    ],
)
def test_what_cannot_be_recorded_is_refused_in_one_sentence(text, sentence):
    with pytest.raises(USER_ERRORS, match=sentence) as refused:
        assert named(text)[1].message
    assert "\n" not in str(refused.value)
