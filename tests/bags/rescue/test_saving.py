"""`rescue` copies whole records as they are, and its certificate bounds what was lost."""

import json
import struct
from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.main import main
from serd_bag.command.rewrite import convert
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import CERTIFICATE, MARK, PAGE, rescue
from serd_bag.topic import ROS1

TEXT = "std_msgs/msg/String"
QOS = (
    "- history: 1\n  depth: 7\n  deadline:\n    sec: 3\n    nsec: 5\n  lifespan: {sec: 2, nsec: 1}"
)


def write_file(path, rows, *, size=1 << 20, **options):
    """rows: (topic, encoding, schema name, schema encoding, schema, sequence, two times, data)."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=size, **options)
        writer.start("ros2")
        schemas, channels = {0: 0}, {}
        for topic, encoding, name, kind, schema, sequence, log_ns, sent_ns, data in rows:
            key = (name, kind, schema)
            if name and key not in schemas:
                schemas[key] = writer.register_schema(name, kind, schema)
            of = schemas.get(key, 0)
            if (topic, encoding, of) not in channels:
                metadata = {"offered_qos_profiles": QOS, "node": "/camera"}
                channels[topic, encoding, of] = writer.register_channel(
                    topic, encoding, of, metadata
                )
            writer.add_message(channels[topic, encoding, of], log_ns, data, sent_ns, sequence)
        writer.add_attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
        writer.add_metadata("robot", {"name": "one"})
        writer.finish()
    return path


def rows_of(number, size=300, topics=("/odom", "/scan")):
    rng = np.random.default_rng(7)
    for count in range(number):
        data = b"\0\1\0\0" + struct.pack("<I", size) + rng.bytes(size - 1) + b"\0"
        topic = topics[count % len(topics)]
        yield topic, "cdr", TEXT, "ros2msg", b"string data", count, 10**9 + count, count, data


def described(channel, record):
    values = (record.sequence, record.log_time_ns, record.publish_time_ns, record.data)
    return channel.topic, channel.encoding, channel.type_name, channel.schema, *values


def recorded(path):
    """Of each message, what an independent reader finds in a file."""
    with path.open("rb") as stream:
        return [
            (
                *(channel.topic, channel.message_encoding, schema.name if schema else ""),
                *(schema.data if schema else b"", message.sequence, message.log_time),
                *(message.publish_time, message.data, tuple(channel.metadata.items())),
            )
            for schema, channel, message in NonSeekingReader(stream).iter_messages(
                log_time_order=False
            )
        ]


def test_everything_of_a_record_is_kept_whatever_it_is(tmp_path):
    rows = [
        *rows_of(10),
        ("/j", "json", "", "", b"", 7, 2**63 + 5, 2**64 - 1, b"{}"),
        ("/j", "json", "jsonschema", "jsonschema", b"{}", 8, 0, 0, b"{}"),
        ("/p", "protobuf", "a.B", "protobuf", b"\x0a\x01", 9, 1, 1, b"\x28\xb5\x2f\xfd"),
        ("/odom", "cdr", "std_msgs/msg/Int8", "ros2msg", b"int8 data", 1, 3, 3, b"\0\1\0\0\5"),
    ]
    source = write_file(tmp_path / "a.mcap", rows)
    for number, make in enumerate((rescue, convert)):
        made = make(source, tmp_path / f"new_{number}")
        assert made.n_messages == len(rows)
        file = tmp_path / f"new_{number}" / f"new_{number}_0.mcap"
        found, before = recorded(file), recorded(source)
        if make is rescue:
            assert found == before
        assert [each[:3] + each[4:8] for each in found] == [each[:3] + each[4:8] for each in before]
        with file.open("rb") as stream:
            reader = make_reader(stream)
            assert [each.name for each in reader.iter_attachments()] == ["map.yaml"]
            assert [each.name for each in reader.iter_metadata()] == ["robot", "rosbag2"]
        profile = BagReader(tmp_path / f"new_{number}").layout.metadata["topics_with_message_count"]
        qos = profile[0]["topic_metadata"]["offered_qos_profiles"][0]
        assert (qos["history"], qos["deadline"]) == ("keep_last", {"sec": 3, "nsec": 5})
    assert contents_of_bag(source).n_messages == check_bag(source).n_messages == len(rows)


def test_distro_and_data_of_the_recorder_are_kept(small_bag, tmp_path):
    folder = small_bag()
    text = (folder / "metadata.yaml").read_text()
    text = text.replace("custom_data: null", "custom_data:\n    place: hall").replace(
        "jazzy", "iron"
    )
    (folder / "metadata.yaml").write_text(text)
    rescue(folder, tmp_path / "new")
    values = BagReader(tmp_path / "new").layout.metadata
    assert (values["custom_data"], values["ros_distro"]) == ({"place": "hall"}, "iron")


@pytest.mark.parametrize("compression", CompressionType)
def test_what_a_damaged_chunk_yields_is_saved_and_marked(tmp_path, compression):
    """The messages before the damage are those that were recorded, bit for bit."""
    source = write_file(tmp_path / "a.mcap", rows_of(3000), size=1 << 20, compression=compression)
    whole, content = recorded(source), source.read_bytes()
    place = len(content) // 2
    source.write_bytes(content[:place] + b"\xff" * 3000 + content[place + 3000 :])
    certificate = rescue(source, tmp_path / "new")
    found = recorded(tmp_path / "new" / "new_0.mcap")
    assert len(set(found) - set(whole)) <= 1
    assert len(found) > (2900 if compression is CompressionType.NONE else 1200)
    assert certificate.n_doubtful > 0
    assert certificate.least_lost <= len(set(whole) - set(found)) <= certificate.most_lost
    kept = rescue(source, tmp_path / "verified", doubtful=False)
    assert kept.n_messages == certificate.n_messages - certificate.n_doubtful
    assert set(recorded(tmp_path / "verified" / "verified_0.mcap")) < set(whole)
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        marks = {each.name: each.metadata for each in make_reader(stream).iter_metadata()}[MARK]
    runs = [run for each in json.loads(marks["doubtful"]).values() for run in each]
    assert sum(last - first + 1 for first, last in runs) == certificate.n_doubtful


def test_the_certificate_accounts_for_every_byte_and_bounds_every_topic(tmp_path, capsys):
    source = write_file(tmp_path / "a.mcap", rows_of(200), size=4000)
    content = bytearray(source.read_bytes())
    content[20_000:24_000] = bytes(4000)
    source.write_bytes(content)
    assert main(["rescue", str(source), "--json"]) == 1
    (values,) = json.loads(capsys.readouterr().out)
    kept = json.loads((tmp_path / "a_rescued" / CERTIFICATE).read_text())
    assert kept["topics"] == values["topics"]
    (spans,) = (file["spans"] for file in values["files"])
    assert (spans[0]["start"], spans[-1]["end"]) == (0, len(content))
    assert all(one["end"] == other["start"] for one, other in pairwise(spans))
    damaged = [span for span in spans if span["state"] != "read"]
    assert damaged
    assert all(span["reason"] for span in damaged)
    assert damaged[0]["start"] < 24_000 <= damaged[-1]["end"]
    n_lost = 200 - values["n_messages"]
    assert values["least_lost"] == n_lost == sum(each["least_lost"] for each in values["topics"])
    assert all(each["most_seconds_lost"] > 0 for each in values["topics"])
    page = (tmp_path / "a_rescued" / PAGE).read_text()
    assert "/odom" in page
    assert page.count("<rect") == len(spans) + 2
    for name, foreign in (("none", b""), ("other", b"no recording")):
        source.write_bytes(foreign)
        assert main(["rescue", str(source), "--output", str(tmp_path / name)]) == 2


def test_chunks_that_are_too_large_for_memory_are_read_in_parts(tmp_path, monkeypatch):
    for module in ("data_section", "chunks"):
        monkeypatch.setattr(f"serd_bag.formats.mcap.{module}.LARGEST_CONTENT", 5000)
    monkeypatch.setattr("serd_bag.formats.mcap.data_section._BLOCK", 2000)
    for number, compression in enumerate(CompressionType):
        source = write_file(
            tmp_path / f"{number}.mcap", rows_of(100, size=2500), compression=compression
        )
        certificate = rescue(source, tmp_path / f"new_{number}")
        assert (certificate.n_messages, certificate.damage) == (100, ())
        assert recorded(tmp_path / f"new_{number}" / f"new_{number}_0.mcap") == recorded(source)


def test_messages_of_ros_1_stay_as_they_are_and_convert_makes_them_ros_2(tmp_path):
    store, data = get_typestore(Stores.ROS1_NOETIC), b"\3\0\0\0abc"
    with rosbag1.Writer(tmp_path / "a.bag.active") as writer:
        connection = writer.add_connection("/text", TEXT, typestore=store, callerid="/node")
        for number in range(50):
            writer.write(connection, number, data)
    certificate = rescue(tmp_path / "a.bag.active", tmp_path / "raw")
    assert (certificate.n_messages, certificate.is_complete) == (50, True)
    (channel,) = BagReader(tmp_path / "raw").channels
    assert (channel.encoding, channel.type_name) == (ROS1, "std_msgs/String")
    assert channel.value("callerid") == "/node"
    assert {each.data for each in BagReader(tmp_path / "raw").records()} == {data}
    in_cdr = {bytes(store.ros1_to_cdr(data, TEXT))}
    assert {each.data for each in BagReader(tmp_path / "raw").messages()} == in_cdr
    convert(tmp_path / "raw", tmp_path / "ros2")
    assert {each.data for each in BagReader(tmp_path / "ros2").records()} == in_cdr


def test_a_bag_of_ros_1_that_a_kill_has_cut_gives_all_whole_messages(tmp_path):
    stream, store = BytesIO(), get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(tmp_path / "a.bag") as writer:
        writer.chunk_threshold = 2000
        connection = writer.add_connection("/text", TEXT, typestore=store)
        for number in range(300):
            writer.write(connection, number, struct.pack("<I", 60) + b"x" * 60)
    content = (tmp_path / "a.bag").read_bytes()
    stream.write(content[: content.rindex(b"op=\x05") // 2])
    (tmp_path / "a.bag").write_bytes(stream.getvalue())
    certificate = rescue(tmp_path / "a.bag", tmp_path / "new")
    assert certificate.n_messages >= stream.getvalue().count(b"op=\x02") - 1 > 100
    assert certificate.most_lost is None
    assert {topic.most_seconds_lost for topic in certificate.topics} == {None}


def test_of_a_named_topic_with_two_types_the_messages_of_the_first_are_read(tmp_path):
    other = ("/odom", "cdr", "std_msgs/msg/Int8", "ros2msg", b"int8 data", 1, 3, 3, b"\0\1\0\0\5")
    alike = ("/odom", "cdr", TEXT, "ros2msg", b"# old\nstring data", 1, 4, 4, b"\0\1\0\0\0\0\0\0")
    source = write_file(tmp_path / "a.mcap", [*rows_of(6), other, alike])
    reader = BagReader(source)
    assert len(list(reader.messages())) == 8
    assert {each.type_name for each in reader.messages(["/odom"])} == {TEXT}
    assert [each.what for each in reader.damage] == [
        "1 messages are of another type than the first of their topic"
    ]
    assert len(list(BagReader(source).messages(["/odom"]))) == 4
