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
KINDS = {"/odom": ODOM, "/cmd_vel": TWIST, "/state": OWN, "/tf": TF}
START_S = 1_700_000_000
COMPRESSIONS = [None, *Writer.CompressionFormat]


@pytest.fixture(scope="module")
def store():
    known = get_typestore(Stores.ROS1_NOETIC)
    known.register(get_types_from_msg("Header header\nfloat32[3] place\nstring text", OWN))
    known.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    return known


@pytest.fixture(params=COMPRESSIONS, ids=["plain", "bz2", "lz4"])
def ros1_bag(request, tmp_path, store):
    """8 s of a robot that drives east at 1 m/s, by odometry, commands, an own type and tf."""

    def make(name, *values):
        package, short = name.split("/")
        return store.types[f"{package}_msgs/msg/{short}"](*values)

    writer = Writer(tmp_path / "drive.bag")
    writer.chunk_threshold = 10_000
    if request.param is not None:
        writer.set_compression(request.param)
    still, ahead = (make("geometry/Vector3", x, 0.0, 0.0) for x in (0.0, 1.0))
    straight, zero = make("geometry/Quaternion", 0.0, 0.0, 0.0, 1.0), np.zeros(36)
    twist = make("geometry/TwistWithCovariance", make("geometry/Twist", still, still), zero)
    with writer:
        to = {name: writer.add_connection(name, KINDS[name], typestore=store) for name in KINDS}
        for number in range(81):
            x, time_ns = number / 10, START_S * 10**9 + number * 10**8
            stamp = store.types["builtin_interfaces/msg/Time"](*divmod(time_ns, 10**9))
            odom, tf, state = (
                make("std/Header", number, stamp, frame) for frame in ("odom", "/odom", "map")
            )
            pose = make("geometry/Pose", make("geometry/Point", x, 0.5, 0.0), straight)
            moved = make("geometry/Transform", make("geometry/Vector3", x, 0.5, 0.0), straight)
            place = np.array([x, 0.5, 0.0], dtype=np.float32)
            sent = {
                "/odom": store.types[ODOM](
                    odom, "base_link", make("geometry/PoseWithCovariance", pose, zero), twist
                ),
                "/cmd_vel": make("geometry/Twist", ahead, still),
                "/state": store.types[OWN](state, place, "né"),
                "/tf": store.types[TF](
                    [make("geometry/TransformStamped", tf, "/base_link", moved)]
                ),
            }
            for name, message in sent.items():
                writer.write(to[name], time_ns, store.serialize_ros1(message, KINDS[name]))
    return tmp_path / "drive.bag"


def test_messages_are_those_of_ros_2_with_their_definitions(ros1_bag):
    reader = BagReader(ros1_bag)
    assert {name: topic.type_name for name, topic in reader.topics.items()} == KINDS
    assert reader.topics["/odom"].message_type.type_hash == message_type(ODOM).type_hash
    found = list(reader.messages(["/odom", "/state"]))
    assert len(found) == 162
    last = {each.topic: each.data for each in found[-2:]}
    odom = decode(last["/odom"], ODOM)
    assert (odom.header.frame_id, odom.header.stamp.sec) == ("odom", START_S + 8)
    assert (odom.pose.pose.position.x, odom.child_frame_id) == (8.0, "base_link")
    state = decode(last["/state"], OWN, typestore_of(reader.topics["/state"].message_type))
    assert (state.text, state.place.tolist()) == ("né", [8.0, 0.5, 0.0])
    assert found[-1].log_time_ns == (START_S + 8) * 10**9
    read = field_reader(reader.topics["/odom"], (), POSES, "pose_fields", "a pose")
    assert read.numbers[0] == "pose.pose.position.x"


def test_drives_are_read_from_it_and_it_is_checked_and_converted(ros1_bag, tmp_path):
    for mapping in (
        BagMapping(pose_topic="odom", action_from="velocity", action_topic="cmd_vel"),
        BagMapping(pose_topic="tf", frame="odom", action_from="motion"),
        BagMapping(pose_topic="state", pose_fields=("place.0", "place.1"), action_from="motion"),
    ):
        drive = mapped_drive_in(BagReader(ros1_bag), mapping)
        np.testing.assert_allclose(drive.position_m[[0, -1]], [[0, 0.5], [8, 0.5]], atol=1e-6)
        assert drive.intent_action.tolist() == [Action.EAST]
    check = check_bag(ros1_bag)
    assert check.faults == ()
    assert any("has no checksums" in remark for remark in check.remarks)
    assert convert(ros1_bag, tmp_path / "new").counts == dict.fromkeys(KINDS, 81)
    old, new = (
        sorted((each.topic, each.data) for each in BagReader(path).messages())
        for path in (ros1_bag, tmp_path / "new")
    )
    assert new == old


def chunks_of(path):
    """(place of its head, of its content and of its index, messages) of each chunk."""
    with Reader(path) as sound:
        return [
            (each.pos, chunk.datapos, chunk.datapos + chunk.datasize, sum(counts.values()))
            for each, chunk in zip(sound.chunk_infos, sound.chunks.values(), strict=True)
            for counts in [each.connection_counts]
        ]


@pytest.mark.parametrize("part", ["head", "compression", "content", "index"])
def test_a_damaged_chunk_costs_its_own_messages(ros1_bag, part):
    whole, content = [each.data for each in BagReader(ros1_bag).messages()], ros1_bag.read_bytes()
    chunks = chunks_of(ros1_bag)
    assert len(chunks) > 5
    for head, start, index, n_messages in (chunks[0], chunks[3], chunks[-1]):
        middle = start + (index - start) // 2
        place = {"head": head, "compression": head + 10, "content": middle, "index": index + 55}
        write_wrong(ros1_bag, content, place[part], b"\xff" * 4)
        reader = BagReader(ros1_bag, tolerant=True)
        found = [each.data for each in reader.messages()]
        assert (Counter(whole) - Counter(found)).total() <= n_messages
        assert reader.losses.n_messages == len(whole) - len(found)
        # Without checksums a number in a message may be another.
        assert reader.damage or set(found) - set(whole)
        if reader.damage:
            assert reader.damage[0].offset == head
            with pytest.raises(BagError, match=r"a chunk is damaged .* it with 'serd bag recov"):
                list(BagReader(ros1_bag).messages())


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
    compressed = b"compression=none" not in ros1_bag.read_bytes()
    reader = BagReader(ros1_bag, tolerant=True)
    assert (len(list(reader.messages())) < 4 * 81) == compressed
    assert bool(reader.damage) == compressed
