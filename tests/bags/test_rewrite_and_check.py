"""Recovered and converted bags hold every readable message; check lists faults."""

import signal
import subprocess
import sys
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import pytest
from mcap.writer import Writer as FileWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.rewrite import convert, recover
from serd_bag.errors import BagError
from serd_bag.formats.mcap.writer import McapWriter
from serd_bag.formats.rosbag2.message_types import MessageType, message_type
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter

REAL_BAG = Path(__file__).parents[2].parent / "shared" / "data" / "bags" / "test-bag"
POSE = "geometry_msgs/msg/PoseStamped"
needs_real_bag = pytest.mark.skipif(
    not REAL_BAG.is_dir(), reason="the real robot bag is not in ../shared/data/bags"
)


def messages_in(folder):
    return [tuple(message) for message in BagReader(folder).messages()]


def test_a_killed_recording_is_recovered_whole_and_rosbags_opens_it(small_bag, tmp_path):
    folder = small_bag()
    before = messages_in(folder)
    (folder / "metadata.yaml").unlink()
    file = folder / "small_0.mcap"
    file.write_bytes(file.read_bytes()[: -file.stat().st_size // 4])
    report = recover(folder, tmp_path / "recovered")
    after = messages_in(tmp_path / "recovered")
    assert after == before[: len(after)]
    assert report.n_messages == len(after) > 30
    assert report.n_lost is None
    assert len(report.damage) == 2
    with AnyReader([tmp_path / "recovered"]) as reader:
        assert reader.message_count == len(after)


def test_a_folder_that_holds_something_is_refused_and_kept(small_bag, tmp_path):
    occupied = tmp_path / "mine"
    occupied.mkdir()
    (occupied / "notes.txt").write_text("keep")
    with pytest.raises(BagError, match="must be new or empty"):
        convert(small_bag(), occupied)
    assert [path.name for path in occupied.iterdir()] == ["notes.txt"]


def test_an_empty_folder_becomes_the_new_bag(small_bag, tmp_path):
    source, target = small_bag(), tmp_path / "new"
    target.mkdir()
    report = convert(source, target)
    assert report.target == target
    assert messages_in(target) == messages_in(source)
    assert (target / "new_0.mcap").is_file()


_CONVERT = """
import os, signal, sys
from serd_bag.reader import BagReader
from serd_bag.command.rewrite import convert
messages = BagReader.messages
def killed_midway(self, topics=None):
    for number, message in enumerate(messages(self, topics)):
        if number == 30:
            os.kill(os.getpid(), signal.SIGKILL)
        yield message
BagReader.messages = killed_midway
convert(sys.argv[1], sys.argv[2])
"""


def test_a_killed_conversion_leaves_no_incomplete_bag_under_the_name(small_bag, tmp_path):
    target = tmp_path / "new"
    command = [sys.executable, "-c", _CONVERT, str(small_bag()), str(target)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert not target.exists()


KINDS = [
    (storage, mode)
    for storage in (StoragePlugin.SQLITE3, StoragePlugin.MCAP)
    for mode in CompressionMode
    if (storage, mode) != (StoragePlugin.SQLITE3, CompressionMode.STORAGE)
]


@pytest.mark.parametrize(("storage", "mode"), KINDS)
def test_every_kind_of_bag_is_read_and_converted(tmp_path, messages, storage, mode):
    with_compression = Writer(tmp_path / "their", version=9, storage_plugin=storage)
    with_compression.set_compression(mode, CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_JAZZY)
    written = [messages.pose(number, 0.0, 0.0) for number in range(20)]
    with with_compression as writer:
        connection = writer.add_connection("/robot_pose", POSE, typestore=store)
        for number, data in enumerate(written):
            writer.write(connection, number, data)
    assert [each.data for each in BagReader(tmp_path / "their").messages()] == written
    report = convert(tmp_path / "their", tmp_path / "our", compression="zstd")
    assert report.counts == {"/robot_pose": 20}
    assert [message[2] for message in messages_in(tmp_path / "our")] == written


@needs_real_bag
def test_the_real_bag_is_converted_with_types_that_are_not_installed(tmp_path):
    report = convert(REAL_BAG, tmp_path / "real")
    assert report.n_messages == 2862
    assert report.counts["/odom"] == 290
    assert report.counts["/cmd_vel"] == 391
    assert (report.counts["/accel"], report.skipped) == (290, {})
    key = itemgetter(0, 2)
    assert sorted(messages_in(tmp_path / "real"), key=key) == sorted(messages_in(REAL_BAG), key=key)
    with AnyReader([tmp_path / "real"]) as reader:
        odometry = next(each for each in reader.connections if each.topic == "/odom")
        for connection, _, data in reader.messages(connections=[odometry]):
            reader.deserialize(data, connection.msgtype)


@pytest.mark.parametrize(
    ("definition", "encoding"),
    [
        (MessageType("mine/msg/Mine", "float64 x\n", ""), "ros2msg"),
        (MessageType("mine/msg/Mine", "module mine {};", "", "ros2idl"), "ros2idl"),
        (MessageType("mine/msg/Mine", "", "", ""), ""),
    ],
)
def test_messages_of_unknown_types_are_copied_with_all_that_is_known(
    tmp_path, messages, definition, encoding
):
    with BagWriter(tmp_path / "old") as writer:
        writer.add_topic("/mine", definition)
        for number in range(9):
            writer.write("/mine", messages.pose(number, 0.0, 0.0), number)
    report = convert(tmp_path / "old", tmp_path / "new")
    assert (report.counts, report.n_left_out) == ({"/mine": 9}, 0)
    recorded = BagReader(tmp_path / "new").topics["/mine"].message_type
    assert (recorded.text, recorded.encoding) == (definition.text, encoding)
    assert messages_in(tmp_path / "new") == messages_in(tmp_path / "old")
    with Reader(tmp_path / "new") as reader:
        assert reader.message_count == 9


def test_the_hash_of_a_definition_recorded_without_one_is_computed(tmp_path):
    known = message_type(POSE)
    with BagWriter(tmp_path / "old") as writer:
        writer.add_topic("/pose", MessageType(POSE, known.text, ""))
    convert(tmp_path / "old", tmp_path / "new")
    assert BagReader(tmp_path / "old").topics["/pose"].message_type.type_hash == ""
    assert BagReader(tmp_path / "new").topics["/pose"].message_type.type_hash == known.type_hash


def test_check_reads_stamps_by_the_definition_in_the_bag(tmp_path, messages):
    text = "std_msgs/Header header\nfloat64 x\n"
    with BagWriter(tmp_path / "old") as writer:
        writer.add_topic("/mine", MessageType("a/msg/B", text, ""))
        writer.write("/mine", messages.pose(1.0, 0.0, 0.0), 3 * 10**9)
    (topic,) = check_bag(tmp_path / "old").topics
    assert topic.stamp_delay_s == (2.0, 2.0)


def test_messages_that_are_not_cdr_are_left_out_and_counted(small_bag, tmp_path, monkeypatch):
    add_topic = McapWriter.add_topic
    monkeypatch.setattr(
        McapWriter, "add_topic", lambda self, each: add_topic(self, replace(each, encoding="json"))
    )
    bag = small_bag()
    monkeypatch.undo()
    report = convert(bag, tmp_path / "new")
    assert report.left_out == {"/robot_pose": 60, "/intent": 9}
    assert report.skipped["/intent"] == "its messages are json, not cdr"
    assert (report.n_messages, report.n_left_out) == (0, 69)


def test_check_finds_nothing_wrong_with_a_sound_bag(small_bag):
    check = check_bag(small_bag(), required=["robot_pose", "/intent"])
    assert check.sound
    assert check.n_messages == 69
    pose = next(topic for topic in check.topics if topic.name == "/robot_pose")
    assert pose.rate_hz == pytest.approx(20.0)
    assert pose.stamp_delay_s == (0.0, 0.0)
    assert (pose.n_gaps, pose.n_log_steps_back, pose.n_stamp_steps_back) == (0, 0, 0)


def test_check_reports_gaps_jumps_and_missing_topics(tmp_path, messages):
    stamps_s = [1.0, 1.1, 1.2, 3.2, 3.3, 0.5, 0.6]
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/robot_pose", POSE)
        writer.add_topic("/empty", POSE)
        for stamp_s in stamps_s:
            time_ns = round(stamp_s * 1e9)
            writer.write("/robot_pose", messages.pose(stamp_s, 0.0, 0.0), time_ns + 250_000_000)
    check = check_bag(tmp_path / "bag", required=["robot_pose", "intent"])
    assert check.faults == ("topic intent has no message",)
    assert check.remarks == (
        "/empty: no message",
        "/robot_pose: 1 gap, the longest 2.00 s",
        "/robot_pose: log time steps back once",
        "/robot_pose: stamps step back once",
    )
    assert check.topics[1].stamp_delay_s == pytest.approx((0.25, 0.25))


@pytest.mark.parametrize(
    ("times_s", "rate_hz", "mean_hz", "n_gaps"),
    [
        ([0.05 * (step // 3) for step in range(300)], 60.0, 299 / 4.95, 0),  # three at a time
        ([0.0, 0.1, 0.2, 9.8, 9.9, 10.0], 10.0, 0.5, 1),
        ([0.00025 * step for step in range(100)], 4000.0, 4000.0, 0),
        ([1.0, 1.00002], None, None, 0),
        ([1.0], None, None, 0),
    ],
)
def test_the_usual_rate_is_that_of_bursts_times_their_size_and_the_mean_counts_pauses_too(
    tmp_path, messages, times_s, rate_hz, mean_hz, n_gaps
):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/robot_pose", POSE)
        for time_s in times_s:
            writer.write("/robot_pose", messages.pose(1.0, 0.0, 0.0), round(time_s * 1e9))
    (topic,) = check_bag(tmp_path / "bag").topics
    assert topic.rate_hz == (rate_hz and pytest.approx(rate_hz, rel=0.02))
    assert topic.mean_hz == (mean_hz and pytest.approx(mean_hz))
    assert topic.n_gaps == n_gaps


@pytest.mark.parametrize(
    ("required", "faults"),
    [
        ("pose", ()),
        ("/front/pose", ()),
        ("/rear/pose", ("topic /rear/pose has no message; did you mean '/front/pose'?",)),
        ("ose", ("topic ose has no message; did you mean '/front/pose'?",)),
        ("empty", ("topic empty has no message",)),
        ("x", ("topic x has no message",)),
    ],
)
def test_a_required_topic_is_that_very_one(tmp_path, messages, required, faults):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/front/pose", POSE)
        writer.add_topic("/front/empty", POSE)
        writer.write("/front/pose", messages.pose(0.0, 0.0, 0.0), 0)
    assert check_bag(tmp_path / "bag", required=[required]).faults == faults


def foreign_file(path, messages, kinds, times_ns):
    """An MCAP file with a channel of one topic for each kind, by turns."""
    with path.open("wb") as stream:
        writer = FileWriter(stream)
        writer.start(profile="ros2")
        channels = [
            writer.register_channel("/pose", "cdr", writer.register_schema(name, "ros2msg", text))
            for name, text in kinds
        ]
        for number, time_ns in enumerate(times_ns):
            data = messages.pose(number, 1.0, 2.0)
            writer.add_message(channels[number % len(channels)], time_ns, data, time_ns)
        writer.finish()
    return path


def test_messages_of_a_second_type_are_left_out_and_counted(messages, tmp_path):
    text = message_type(POSE).text
    commented = "# as recorded elsewhere\n" + text
    kinds = [(POSE, text.encode()), (POSE, commented.encode()), (POSE, b"float64 other")]
    bag = foreign_file(tmp_path / "two.mcap", messages, kinds, range(90))
    faults = check_bag(bag).faults
    assert any("30 messages are of another type than the first of their topic" in f for f in faults)
    report = recover(bag, tmp_path / "kept")
    assert (report.n_messages, report.n_lost) == (60, 30)
    with AnyReader([tmp_path / "kept"]) as reader:
        for connection, _, data in reader.messages():
            assert reader.deserialize(data, connection.msgtype).pose.position.x == 1.0


def test_a_channel_without_a_definition_may_have_the_type_of_its_topic(messages, tmp_path):
    kinds = [(POSE, b""), (POSE, message_type(POSE).text.encode())]
    bag = foreign_file(tmp_path / "brief.mcap", messages, kinds, range(40))
    assert check_bag(bag).sound
    assert recover(bag, tmp_path / "kept").n_messages == 40


@pytest.mark.parametrize("time_ns", [2**63, 2**64 - 1])
def test_a_time_that_no_bag_can_hold_costs_its_message_alone(messages, tmp_path, time_ns):
    kinds = [(POSE, message_type(POSE).text.encode())]
    bag = foreign_file(tmp_path / "odd.mcap", messages, kinds, [*range(40), time_ns])
    check = check_bag(bag)
    assert any("1 messages have times outside of 0 to 2^63-1 ns" in f for f in check.faults)
    report = recover(bag, tmp_path / "kept")
    assert (report.n_messages, report.n_lost) == (40, 1)
