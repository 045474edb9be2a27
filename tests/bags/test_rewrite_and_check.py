"""Recovered and converted bags hold every readable message; check lists faults."""

import signal
import subprocess
import sys
from dataclasses import replace

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.rewrite import convert
from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from serd_bag.topic import MessageType
from support.bag_messages import POSE, write_bag


def messages_in(folder):
    return [tuple(message) for message in BagReader(folder).messages()]


def bag_of_poses(folder, messages, times_s, stamps_s=None):
    poses = [messages.pose(stamp_s, 0.0, 0.0) for stamp_s in stamps_s or times_s]
    rows = [("/robot_pose", *row) for row in zip(times_s, poses, strict=True)]
    return write_bag(folder, {"/robot_pose": POSE, "/empty": POSE}, rows)


def test_a_killed_recording_is_recovered_whole_and_rosbags_opens_it(small_bag, tmp_path):
    folder = small_bag()
    before = messages_in(folder)
    (folder / "metadata.yaml").unlink()
    file = folder / "small_0.mcap"
    file.write_bytes(file.read_bytes()[: -file.stat().st_size // 4])
    report = rescue(folder, tmp_path / "recovered")
    after = messages_in(tmp_path / "recovered")
    assert after == before[: len(after)]
    assert report.n_messages == len(after) > 30
    assert (report.least_lost, report.most_lost, len(report.damage)) == (0, None, 2)
    with AnyReader([tmp_path / "recovered"]) as reader:
        assert reader.message_count == len(after)


def test_an_empty_folder_becomes_the_new_bag_and_one_that_holds_something_is_kept(
    small_bag, tmp_path
):
    source, target = small_bag(), tmp_path / "new"
    target.mkdir()
    assert convert(source, target).target == target
    assert messages_in(target) == messages_in(source)
    names = sorted(path.name for path in target.iterdir())
    assert names == ["metadata.yaml", "new_0.mcap"]
    with pytest.raises(BagError, match="must be new or empty"):
        convert(source, target)
    assert sorted(path.name for path in target.iterdir()) == names


_CONVERT = """
import os, signal, sys
from serd_bag.command.rewrite import convert
from serd_bag.writer import BagWriter
write = BagWriter.write_record
def killed_midway(self, record):
    if self.n_messages == 30:
        os.kill(os.getpid(), signal.SIGKILL)
    write(self, record)
BagWriter.write_record = killed_midway
convert(sys.argv[1], sys.argv[2])
"""


def test_a_killed_conversion_leaves_no_incomplete_bag_under_the_name(small_bag, tmp_path):
    target = tmp_path / "new"
    command = [sys.executable, "-c", _CONVERT, str(small_bag()), str(target)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert not target.exists()


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        *((StoragePlugin.MCAP, mode) for mode in CompressionMode),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    ],
)
def test_every_kind_of_bag_is_read_and_converted(tmp_path, messages, storage, mode):
    with_compression = Writer(tmp_path / "their", version=9, storage_plugin=storage)
    with_compression.set_compression(mode, CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_JAZZY)
    written = [messages.pose(number, 0.0, 0.0) for number in range(20)]
    with with_compression as writer:
        connection = writer.add_connection("/robot_pose", POSE, typestore=store)
        for number, data in enumerate(written):
            writer.write(connection, number, data)
    report = convert(tmp_path / "their", tmp_path / "our", compression="zstd")
    assert report.counts == {"/robot_pose": 20}
    for folder in ("their", "our"):
        assert [each.data for each in BagReader(tmp_path / folder).messages()] == written


@pytest.mark.parametrize(
    ("definition", "type_hash"),
    [
        (MessageType("mine/msg/Mine", "module mine {};", "", "ros2idl"), ""),
        (MessageType("mine/msg/Mine", "", "", ""), ""),
        (MessageType(POSE, message_type(POSE).text, ""), message_type(POSE).type_hash),
    ],
)
def test_messages_of_any_type_are_copied_with_all_that_is_known(tmp_path, definition, type_hash):
    rows = [("/mine", number, bytes(20)) for number in range(9)]
    write_bag(tmp_path / "old", {"/mine": definition}, rows)
    report = convert(tmp_path / "old", tmp_path / "new")
    assert report.counts == {"/mine": 9}
    assert BagReader(tmp_path / "old").topics["/mine"].message_type.type_hash == ""
    recorded = BagReader(tmp_path / "new").topics["/mine"].message_type
    assert recorded == replace(definition, type_hash=type_hash)
    assert messages_in(tmp_path / "new") == messages_in(tmp_path / "old")
    with Reader(tmp_path / "new") as reader:
        assert reader.message_count == 9


def test_check_reports_gaps_jumps_and_missing_topics(tmp_path, messages):
    stamps_s = [1.0, 1.1, 1.2, 3.2, 3.3, 0.5, 0.6]
    times_s = [stamp_s + 0.25 for stamp_s in stamps_s]
    bag = bag_of_poses(tmp_path / "bag", messages, times_s, stamps_s)
    check = check_bag(bag, required=["robot_pose", "intent"])
    assert check.faults == ("topic intent has no message",)
    assert check.remarks == (
        "/empty: no message",
        "/robot_pose: 1 gap, the longest 2.00 s",
        "/robot_pose: log time steps back once",
        "/robot_pose: stamps step back once",
    )
    assert check.topics[1].stamp_delay_s == pytest.approx((0.25, 0.25))


@pytest.mark.parametrize(
    ("times_s", "mean_hz", "n_gaps"),
    [
        ([0.05 * (step // 3) for step in range(300)], 299 / 4.95, 0),  # three at a time
        ([0.0, 0.1, 0.2, 9.8, 9.9, 10.0], 0.5, 1),
        ([1.0, 1.00002], None, 0),
    ],
)
def test_the_mean_rate_counts_pauses_and_gaps_are_those_between_bursts(
    tmp_path, messages, times_s, mean_hz, n_gaps
):
    _, topic = check_bag(bag_of_poses(tmp_path / "bag", messages, times_s)).topics
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
    topics = {"/front/pose": POSE, "/front/empty": POSE}
    rows = [("/front/pose", 0.0, messages.pose(0.0, 0.0, 0.0))]
    bag = write_bag(tmp_path / "bag", topics, rows)
    assert check_bag(bag, required=[required]).faults == faults
