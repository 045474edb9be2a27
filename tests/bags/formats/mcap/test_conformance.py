"""Files in all forms of the MCAP format are sound, and no checksum of them is ignored."""

import struct
from itertools import product

import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Message
from mcap.writer import CompressionType, IndexType, Writer

from serd_bag.command.rewrite import convert
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from support.damaged_files import write_flipped, write_wrong
from support.mcap_files import CONTENTS, Feature, mcap_file, variants

_OPTIONS = (
    "repeat_channels", "repeat_schemas", "use_chunking", "use_statistics",
    "use_summary_offsets", "enable_crcs", "enable_data_crcs",
)  # fmt: skip


def found_in(path):
    scan = McapScan(path, thorough=True)
    messages = [(each.log_time_ns, each.publish_time_ns, each.data) for each in scan.messages()]
    return messages, [each.sentence() for each in scan.damage]


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("checksums", [True, False])
def test_files_with_every_combination_of_features_are_sound(tmp_path, content, checksums):
    path = tmp_path / "file.mcap"
    records = CONTENTS[content]
    expected = [
        (record.log_time, record.publish_time, record.data)
        for record in records
        if isinstance(record, Message)
    ]
    topics = {record.topic for record in records if isinstance(record, Channel)}
    for _, features in (each for each in variants() if each[0] == content):
        path.write_bytes(mcap_file(records, features, checksums=checksums))
        assert found_in(path) == (expected, []), features
        assert {topic.name for topic in McapScan(path).topics()} == topics, features


@pytest.mark.parametrize(
    ("content", "features"),
    [
        ("OneMessage", Feature.NONE),
        ("OneMessage", Feature.CHUNKS),
        ("OneMessage", ~Feature.EXTRA_DATA),
        ("OneAttachment", Feature.ATTACHMENT_INDEX),
        ("OneMetadata", Feature.METADATA_INDEX),
    ],
)
def test_every_flipped_bit_is_reported_where_checksums_cover_the_file(tmp_path, content, features):
    path = tmp_path / "file.mcap"
    whole = mcap_file(CONTENTS[content], features)
    for place, bit in product(range(len(whole)), range(8)):
        write_flipped(path, whole, place, bit)
        assert found_in(path)[1], (place, bit)


@pytest.mark.parametrize("features", [Feature.NONE, Feature.CHUNKS])
@pytest.mark.parametrize("checksums", [True, False])
def test_check_reports_files_without_checksums(tmp_path, features, checksums):
    path = tmp_path / "file.mcap"
    path.write_bytes(mcap_file(CONTENTS["OneMessage"], features, checksums=checksums))
    check = check_bag(path)
    assert check.sound
    assert any("has no checksums" in remark for remark in check.remarks) != checksums


def test_a_flipped_bit_of_an_attachment_is_reported_by_its_own_checksum(tmp_path):
    path = tmp_path / "file.mcap"
    whole = mcap_file(CONTENTS["OneAttachment"], Feature.NONE, checksums=False)
    write_flipped(path, whole, whole.index(b"\1\2\3"))
    (fault,) = found_in(path)[1]
    assert "the checksum of an attachment does not fit its content" in fault


def write(path, n_messages, **options):
    """A file of the official writer; its messages."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for number in range(n_messages):
            data = b"\0\1\0\0" + bytes([number % 256]) * 20
            writer.add_message(channel, log_time=number, data=data, publish_time=number + 1)
        writer.add_attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
        writer.add_metadata("robot", {"name": "one"})
        writer.finish()
    return [(n, n + 1, b"\0\1\0\0" + bytes([n % 256]) * 20) for n in range(n_messages)]


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("index_types", [IndexType.ALL, IndexType.NONE])
def test_all_option_sets_of_the_official_writer_are_sound(tmp_path, compression, index_types):
    path = tmp_path / "file.mcap"
    for values in product([True, False], repeat=len(_OPTIONS)):
        options = dict(zip(_OPTIONS, values, strict=True))
        options |= {"compression": compression, "index_types": index_types}
        expected = write(path, 12, chunk_size=100, **options)
        assert found_in(path) == (expected, []), options


@pytest.mark.parametrize("use_chunking", [True, False])
def test_no_flip_in_a_file_of_the_official_writer_is_silent(tmp_path, use_chunking):
    path = tmp_path / "file.mcap"
    write(path, 3, use_chunking=use_chunking, enable_data_crcs=True)
    whole = path.read_bytes()
    for place, bit in ((place, place * 3 % 8) for place in range(len(whole))):
        write_flipped(path, whole, place, bit)
        assert found_in(path)[1], (place, bit)


def test_records_of_later_versions_are_skipped(tmp_path):
    path = tmp_path / "file.mcap"
    whole = mcap_file(CONTENTS["OneMessage"], Feature.NONE, checksums=False)
    at = whole.index(b"\x03", 8)  # the schema
    later = b"".join(struct.pack("<BQ", code, 5) + b"later" for code in (0x10, 0x7F, 0x80, 0xFF))
    path.write_bytes(whole[:at] + later + whole[at:])
    assert found_in(path) == ([(2, 1, b"\1\2\3")], [])


def test_a_channel_behind_its_first_message_in_a_chunk_is_found(tmp_path):
    path = tmp_path / "file.mcap"
    schema, channel, message = CONTENTS["OneMessage"]
    path.write_bytes(mcap_file([message, channel, schema], Feature.CHUNKS))
    assert found_in(path) == ([(2, 1, b"\1\2\3")], [])


def test_one_bad_record_of_a_summary_without_checksum_costs_only_itself(tmp_path):
    path = tmp_path / "file.mcap"
    write(path, 3, enable_crcs=False)
    whole = path.read_bytes()
    at = whole.rindex(b"std_msgs/msg/String") - 4  # size of the name in the summary
    write_wrong(path, whole, at, b"\xff")
    scan = McapScan(path)
    assert len(list(scan.messages())) == scan.expected == 3
    assert any("in the summary, a schema record is damaged" in each.what for each in scan.damage)


def test_a_short_message_in_a_chunk_costs_only_itself(tmp_path):
    path = tmp_path / "file.mcap"
    records = CONTENTS["TenMessages"]
    whole = mcap_file(records, Feature.CHUNKS, checksums=False)
    at = whole.index(struct.pack("<BQ", 5, 23))
    unknown = struct.pack("<BQ", 5, 14) + bytes(14)
    write_wrong(path, whole, at, unknown)
    found, damage = found_in(path)
    assert any("a message is shorter than its fields" in each for each in damage)
    assert len(found) == 9


def test_attachments_and_metadata_are_in_the_converted_bag(tmp_path):
    write(tmp_path / "old.mcap", 3)
    convert(tmp_path / "old.mcap", tmp_path / "new")
    file = tmp_path / "new" / "new_0.mcap"
    with file.open("rb") as stream:
        reader = make_reader(stream)
        (attachment,) = reader.iter_attachments()
        names = [each.name for each in reader.iter_metadata()]
    assert attachment == Attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
    assert names == ["robot", "rosbag2"]
    assert check_bag(tmp_path / "new").sound
    assert len(list(BagReader(tmp_path / "new").messages())) == 3
