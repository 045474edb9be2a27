"""Bags written here are read byte by byte by the readers of rosbags and mcap."""

import errno
import os

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability

from serd_bag.errors import BagError
from serd_bag.formats.limits import flow_yaml_text, yaml_values
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.formats.rosbag2.qos import QosProfile
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from support.bag_messages import POSE, TWIST


@pytest.mark.parametrize("options", [{}, {"compression": "zstd"}, {"max_file_bytes": 4000}])
def test_rosbags_reads_back_every_byte_and_time(small_bag, options):
    folder = small_bag(**options)
    with AnyReader([folder]) as reader:
        assert reader.message_count == 69
        theirs = [
            (each.topic, each.msgtype, bytes(data), time_ns)
            for each, time_ns, data in reader.messages()
        ]
        for connection in reader.connections:
            assert connection.digest == message_type(connection.msgtype).type_hash
            assert connection.msgdef.data == message_type(connection.msgtype).text
    ours = [message[:4] for message in BagReader(folder).messages()]
    assert sorted(ours) == sorted(theirs)
    assert len(ours) == 69


def test_the_reader_of_mcap_finds_indexes_statistics_and_sound_checksums(small_bag):
    folder = small_bag()
    with (folder / "small_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert summary.statistics.message_count == 69
        assert summary.statistics.channel_message_counts == {1: 60, 2: 9}
        assert len(summary.chunk_indexes) == 6
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        channel = summary.channels[1]
        assert channel.metadata["topic_type_hash"] == message_type(POSE).type_hash
        assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["depth"] == 10
        times = [message.log_time for _, _, message in reader.iter_messages("/intent")]
        assert times == sorted(times)
        assert len(times) == 9
        (record,) = reader.iter_metadata()
        assert record.name == "rosbag2"
        inner = yaml.safe_load(record.metadata["serialized_metadata"])
        assert inner["message_count"] == 69


def test_yaml_on_one_line_keeps_every_character():
    odd = "".join(map(chr, [*range(0x300), 0x2028, 0xFEFF, 0xFFFE, 0x1F600]))
    values = {"name": odd, "more": [odd, 1, None, True, 0.5]}
    assert yaml_values(flow_yaml_text(values)) == yaml.safe_load(flow_yaml_text(values)) == values


def test_metadata_is_that_of_version_9(small_bag):
    values = yaml.safe_load((small_bag(max_file_bytes=4000) / "metadata.yaml").read_text())
    info = values["rosbag2_bagfile_information"]
    assert list(info) == [
        "version", "storage_identifier", "duration", "starting_time", "message_count",
        "topics_with_message_count", "compression_format", "compression_mode",
        "relative_file_paths", "files", "custom_data", "ros_distro",
    ]  # fmt: skip
    assert info["version"] == 9
    assert info["starting_time"] == {"nanoseconds_since_epoch": 10_000_000_000}
    assert info["duration"] == {"nanoseconds": 2_950_000_000}
    assert len(info["files"]) > 2
    assert sum(each["message_count"] for each in info["files"]) == info["message_count"] == 69


def test_quality_of_service_survives_also_in_an_empty_bag(tmp_path):
    latched = QosProfile(durability="transient_local", depth=1)
    sensor_data = QosProfile(reliability="best_effort", depth=5)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/map", "nav_msgs/msg/OccupancyGrid", (latched,))
        writer.add_topic("/scan", "sensor_msgs/msg/LaserScan", (sensor_data,))
    assert list(BagReader(tmp_path / "bag").messages()) == []
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 0
        profiles = {each.topic: each.ext.offered_qos_profiles[0] for each in reader.connections}
    assert profiles["/map"].durability == QosDurability.TRANSIENT_LOCAL
    assert profiles["/scan"].reliability == QosReliability.BEST_EFFORT


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda writer: writer.write("/robot_pos", b"", 1), "'/robot_pos' must be added first"),
        (lambda writer: writer.write("/robot_pose", b"", -1), "times must be 0 to"),
        (lambda writer: writer.add_topic("/robot_pose", TWIST), "must keep its type"),
        (lambda writer: BagWriter(writer.directory), "must be new or empty"),
        (lambda writer: BagWriter(writer.directory / "bag_0.mcap" / "bag"), "cannot write"),
    ],
)
def test_wrong_use_raises(tmp_path, wrong, sentence):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/robot_pose", POSE)
        with pytest.raises(BagError, match=sentence):
            wrong(writer)


def test_a_disk_that_fills_up_at_a_split_leaves_a_bag_that_can_be_read(
    tmp_path, messages, monkeypatch
):
    writer = BagWriter(tmp_path / "bag", max_file_bytes=5000)
    writer.add_topic("/robot_pose", POSE)
    real = os.open

    def refuse(path, flags, *rest, **options):
        if str(path).endswith("_1.mcap"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(path, flags, *rest, **options)

    monkeypatch.setattr(os, "open", refuse)
    for number in range(100):
        writer.write("/robot_pose", messages.pose(number, 0.0, 0.0), number)
    with pytest.raises(BagError, match=r"bag_1.mcap: the disk is full"):
        writer.flush()
    assert writer.failed
    writer.close()
    assert len(list(BagReader(tmp_path / "bag").messages())) == 100
