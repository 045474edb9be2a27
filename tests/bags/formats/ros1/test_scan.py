"""Bags of ROS 1 read as the messages of ROS 2, judged by rosbags, which writes them here."""

import re
from collections import Counter

import numpy as np
import pytest
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from serd_app.drives.mapped.drive import mapped_drive_in
from serd_app.drives.mapped.mapping import BagMapping
from serd_bag.command.rewrite import convert
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type, typestore_of
from serd_bag.health.check import check_bag
from serd_bag.messages.fields import POSES, field_reader
from serd_bag.messages.plain import decode
from serd_bag.reader import BagReader
from serd_core.grid.grid import Action
from support.damaged_files import write_wrong

ODOM, TWIST, OWN = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "own_msgs/msg/State"
TF = "tf/msg/tfMessage"
START_S = 1_700_000_000
FORMATS = [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]


@pytest.fixture(scope="module")
def store():
    known = get_typestore(Stores.ROS1_NOETIC)
    known.register(get_types_from_msg("Header header\nfloat32[3] place\nstring text", OWN))
    known.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    return known


def header(store, number, time_s, frame):
    stamp = store.types["builtin_interfaces/msg/Time"](int(time_s), round(time_s % 1 * 1e9))
    return store.types["std_msgs/msg/Header"](number, stamp, frame)


def odometry(store, number, time_s, x):
    types = store.types
    point = types["geometry_msgs/msg/Point"](x, 0.5, 0.0)
    turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    pose = types["geometry_msgs/msg/Pose"](point, turned)
    still = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    zero = np.zeros(36)
    return types[ODOM](
        header(store, number, time_s, "odom"),
        "base_link",
        types["geometry_msgs/msg/PoseWithCovariance"](pose, zero),
        types["geometry_msgs/msg/TwistWithCovariance"](
            types["geometry_msgs/msg/Twist"](still, still), zero
        ),
    )


@pytest.fixture(params=FORMATS, ids=["plain", "bz2", "lz4"])
def ros1_bag(request, tmp_path, store):
    """8 s of a robot that drives east at 1 m/s, by odometry, commands, an own type and tf."""
    path = tmp_path / "drive.bag"
    types = store.types
    writer = Writer(path)
    writer.chunk_threshold = 10_000
    if request.param is not None:
        writer.set_compression(request.param)
    with writer:
        kinds = {"/odom": ODOM, "/cmd_vel": TWIST, "/state": OWN, "/tf": TF}
        to = {
            name: writer.add_connection(name, kind, typestore=store) for name, kind in kinds.items()
        }
        for number in range(81):
            time_s = START_S + number / 10
            ahead = types["geometry_msgs/msg/Vector3"](1.0, 0.0, 0.0)
            still = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            moved = types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](number / 10, 0.5, 0.0),
                types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
            )
            stamped = types["geometry_msgs/msg/TransformStamped"](
                header(store, number, time_s, "/odom"), "/base_link", moved
            )
            own = np.array([number / 10, 0.5, 0.0], dtype=np.float32)
            sent = {
                "/odom": odometry(store, number, time_s, number / 10),
                "/cmd_vel": types[TWIST](ahead, still),
                "/state": types[OWN](header(store, number, time_s, "map"), own, "né"),
                "/tf": types[TF]([stamped]),
            }
            for name, message in sent.items():
                data = store.serialize_ros1(message, kinds[name])
                writer.write(to[name], round(time_s * 1e9), data)
    return path


def test_messages_are_those_of_ros_2_with_their_definitions(ros1_bag):
    reader = BagReader(ros1_bag)
    assert {name: topic.type_name for name, topic in reader.topics.items()} == {
        "/odom": ODOM, "/cmd_vel": TWIST, "/state": OWN, "/tf": TF
    }  # fmt: skip
    assert reader.topics["/odom"].message_type.type_hash == message_type(ODOM).type_hash
    found = list(reader.messages(["/odom", "/state"]))
    assert len(found) == 162
    odom = decode(found[-2].data if found[-2].topic == "/odom" else found[-1].data, ODOM)
    assert (odom.header.frame_id, odom.header.stamp.sec) == ("odom", START_S + 8)
    assert (odom.pose.pose.position.x, odom.child_frame_id) == (8.0, "base_link")
    own = [each for each in found if each.topic == "/state"][-1]
    state = decode(own.data, OWN, typestore_of(reader.topics["/state"].message_type))
    assert (state.text, state.place.tolist()) == ("né", [8.0, 0.5, 0.0])
    assert found[-1].log_time_ns == (START_S + 8) * 10**9
    read = field_reader(reader.topics["/odom"], (), POSES, "pose_fields", "a pose")
    assert read.numbers[0] == "pose.pose.position.x"


@pytest.mark.parametrize(
    "mapping",
    [
        BagMapping(pose_topic="odom", action_from="velocity", action_topic="cmd_vel"),
        BagMapping(pose_topic="tf", frame="odom", action_from="motion"),
        BagMapping(pose_topic="state", pose_fields=("place.0", "place.1"), action_from="motion"),
    ],
    ids=["odometry", "tf", "own type"],
)
def test_a_drive_is_read_from_it(ros1_bag, mapping):
    drive = mapped_drive_in(BagReader(ros1_bag), mapping)
    np.testing.assert_allclose(drive.position_m[[0, -1]], [[0.0, 0.5], [8.0, 0.5]], atol=1e-6)
    assert drive.intent_action.tolist() == [Action.EAST]


def test_it_is_checked_and_converted(ros1_bag, tmp_path):
    assert check_bag(ros1_bag).faults == ()
    report = convert(ros1_bag, tmp_path / "new")
    assert report.counts == dict.fromkeys(("/odom", "/cmd_vel", "/state", "/tf"), 81)
    old = sorted((each.topic, each.data) for each in BagReader(ros1_bag).messages())
    assert sorted((each.topic, each.data) for each in BagReader(tmp_path / "new").messages()) == old


def chunks_of(path):
    """(place of its head, of its content and of its index, messages) of each chunk."""
    with Reader(path) as sound:
        return [
            (each.pos, chunk.datapos, chunk.datapos + chunk.datasize, sum(counts.values()))
            for each, chunk in zip(sound.chunk_infos, sound.chunks.values(), strict=True)
            for counts in [each.connection_counts]
        ]


@pytest.mark.parametrize("part", ["head", "compression", "content", "index"])
@pytest.mark.parametrize("number", [0, 3, -1])
def test_a_damaged_chunk_costs_its_own_messages(ros1_bag, part, number):
    whole = [each.data for each in BagReader(ros1_bag).messages()]
    chunks = chunks_of(ros1_bag)
    assert len(chunks) > 5
    head, content, index, n_messages = chunks[number]
    place = {
        "head": head,
        "compression": head + 4 + 4 + 2,
        "content": content + (index - content) // 2,
        "index": index + 55,
    }[part]
    write_wrong(ros1_bag, ros1_bag.read_bytes(), place, b"\xff" * 4)
    reader = BagReader(ros1_bag, tolerant=True)
    found = [each.data for each in reader.messages()]
    assert (Counter(whole) - Counter(found)).total() <= n_messages
    changed = set(found) - set(whole)
    assert reader.losses.n_messages == len(whole) - len(found)
    assert reader.damage or changed  # without checksums a number in a message may be another
    if reader.damage:
        assert reader.damage[0].offset == head
        with pytest.raises(BagError, match=r"a chunk is damaged .* repair it with 'serd bag recov"):
            list(BagReader(ros1_bag).messages())


def test_check_reports_that_such_files_have_no_checksums(ros1_bag):
    assert any("has no checksums" in remark for remark in check_bag(ros1_bag).remarks)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "seems to be empty; record it again$"),
        (b"#ROSBAG V1.2\n", "Bag version 102 is not supported"),
        (b"#ROSBAG V2.0\n", "; 'rosbag reindex' of ROS 1 may repair it$"),
    ],
)
def test_a_file_without_an_index_gets_a_sentence(tmp_path, content, sentence):
    path = tmp_path / "killed.bag"
    path.write_bytes(content)
    with pytest.raises(BagError, match=sentence):
        BagReader(path)
    assert re.search(sentence, check_bag(path).faults[0])
    with pytest.raises(BagError, match=f"holds bags of ROS 1; give each of them, as {path}"):
        BagReader(tmp_path)


def test_of_a_chunk_no_more_is_unpacked_than_the_limit(ros1_bag, monkeypatch):
    monkeypatch.setattr("serd_bag.formats.ros1.scan.LARGEST_CONTENT", 1000)
    content = ros1_bag.read_bytes()
    compressed = b"compression=bz2" in content or b"compression=lz4" in content
    reader = BagReader(ros1_bag, tolerant=True)
    assert (len(list(reader.messages())) < 4 * 81) == compressed
    assert bool(reader.damage) == compressed
