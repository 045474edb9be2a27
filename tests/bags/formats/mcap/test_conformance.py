"""Files in all forms of the MCAP format are sound, and no checksum of them is ignored."""

import struct
from itertools import product

import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Message, Schema
from mcap.writer import CompressionType, IndexType

from serd_bag.command.rewrite import convert
from serd_bag.formats.mcap.definitions import Definitions
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from support.damaged_files import write_flipped, write_wrong
from support.mcap_files import CONTENTS, Feature, encoded, mcap_file, variants, write_official

_OPTIONS = (
    "repeat_channels", "repeat_schemas", "use_chunking", "use_statistics",
    "use_summary_offsets", "enable_crcs", "enable_data_crcs",
)  # fmt: skip
_ONE_MESSAGE = [(2, 1, b"\1\2\3")]


def found_in(path):
    scan = McapScan(path, thorough=True)
    messages = [(each.log_time_ns, each.publish_time_ns, each.data) for each in scan.records()]
    return messages, [each.sentence() for each in scan.log.damage]


@pytest.mark.parametrize("content", CONTENTS)
def test_files_with_every_combination_of_features_are_sound(tmp_path, content):
    path = tmp_path / "file.mcap"
    records = CONTENTS[content]
    expected = [
        (record.log_time, record.publish_time, record.data)
        for record in records
        if isinstance(record, Message)
    ]
    topics = {record.topic for record in records if isinstance(record, Channel)}
    for number, (_, features) in enumerate(each for each in variants() if each[0] == content):
        path.write_bytes(mcap_file(records, features, checksums=number % 3 > 0))
        assert found_in(path) == (expected, []), features
        assert {channel.topic for channel in McapScan(path).channels()} == topics, features


def test_check_reports_files_without_checksums(tmp_path):
    path = tmp_path / "file.mcap"
    for features, checksums in product((Feature.NONE, Feature.CHUNKS), (True, False)):
        path.write_bytes(mcap_file(CONTENTS["OneMessage"], features, checksums=checksums))
        check = check_bag(path)
        assert check.sound
        assert any("has no checksums" in remark for remark in check.remarks) != checksums


@pytest.mark.parametrize(
    ("content", "features"),
    [
        ("OneMessage", Feature.NONE),
        ("OneMessage", Feature.CHUNKS),
        ("OneMessage", ~Feature.EXTRA_DATA),
        ("OneAttachment", Feature.ATTACHMENT_INDEX),
        ("OneMetadata", Feature.METADATA_INDEX),
        ("official writer", Feature.NONE),
        ("official writer", Feature.CHUNKS),
    ],
)
def test_every_flipped_byte_is_reported_where_checksums_cover_the_file(tmp_path, content, features):
    path = tmp_path / "file.mcap"
    if content in CONTENTS:
        path.write_bytes(mcap_file(CONTENTS[content], features))
    else:
        write_official(path, ["/text"], 3, use_chunking=bool(features), enable_data_crcs=True)
    whole = path.read_bytes()
    for place in range(len(whole)):
        write_flipped(path, whole, place, place * 3 % 8)
        assert found_in(path)[1], place


def test_all_option_sets_of_the_official_writer_are_sound(tmp_path):
    path = tmp_path / "file.mcap"
    kinds = list(product(CompressionType, (IndexType.ALL, IndexType.NONE)))
    for number, values in enumerate(product([True, False], repeat=len(_OPTIONS))):
        compression, index_types = kinds[number % len(kinds)]
        options = dict(zip(_OPTIONS, values, strict=True))
        options |= {"compression": compression, "index_types": index_types}
        expected = write_official(path, ["/text"], 12, chunk_size=100, **options)
        assert found_in(path) == (expected, []), options


def flip_in_an_attachment(path):
    whole = mcap_file(CONTENTS["OneAttachment"], Feature.NONE, checksums=False)
    write_flipped(path, whole, whole.index(b"\1\2\3"))


def shorten_a_message_in_a_chunk(path):
    whole = mcap_file(CONTENTS["TenMessages"], Feature.CHUNKS, checksums=False)
    unknown = struct.pack("<BQ", 5, 14) + bytes(14)
    write_wrong(path, whole, whole.index(struct.pack("<BQ", 5, 23)), unknown)


def lengthen_a_name_in_the_summary(path):
    write_official(path, ["/text"], 3, enable_crcs=False)
    whole = path.read_bytes()
    write_wrong(path, whole, whole.rindex(b"std_msgs/msg/String") - 4, b"\xff")


@pytest.mark.parametrize(
    ("damage", "sentence", "n_messages"),
    [
        (flip_in_an_attachment, "the checksum of an attachment does not fit its content", 0),
        (shorten_a_message_in_a_chunk, "a message is shorter than its fields", 9),
        (lengthen_a_name_in_the_summary, "in the summary, a schema record is damaged", 3),
    ],
)
def test_one_bad_record_is_named_and_costs_only_itself(tmp_path, damage, sentence, n_messages):
    damage(tmp_path / "file.mcap")
    messages, faults = found_in(tmp_path / "file.mcap")
    assert any(sentence in fault for fault in faults)
    assert len(messages) == n_messages


def test_records_of_later_versions_are_skipped_and_channels_found_behind_their_messages(tmp_path):
    path = tmp_path / "file.mcap"
    whole = mcap_file(CONTENTS["OneMessage"], Feature.NONE, checksums=False)
    at = whole.index(b"\x03", 8)  # the schema
    later = b"".join(struct.pack("<BQ", code, 5) + b"later" for code in (0x10, 0x7F, 0x80, 0xFF))
    for content in (
        whole[:at] + later + whole[at:],
        mcap_file(CONTENTS["OneMessage"][::-1], Feature.CHUNKS),
    ):
        path.write_bytes(content)
        assert found_in(path) == (_ONE_MESSAGE, [])


def test_both_times_attachments_and_metadata_are_in_the_converted_bag(tmp_path):
    write_official(tmp_path / "old.mcap", ["/text"], 3)
    convert(tmp_path / "old.mcap", tmp_path / "new")
    converted = list(BagReader(tmp_path / "new").messages())
    assert converted == list(BagReader(tmp_path / "old.mcap").messages())
    assert all(each.publish_time_ns != each.log_time_ns for each in converted)
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        (attachment,) = reader.iter_attachments()
        names = [each.name for each in reader.iter_metadata()]
    assert attachment == Attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
    assert names == ["robot", "rosbag2"]
    assert check_bag(tmp_path / "new").sound
    assert len(list(BagReader(tmp_path / "new").messages())) == 3


_CHANNEL = Channel(1, "/text", "cdr", {"one": "1", "other": "2"}, 1)


@pytest.mark.parametrize(
    "changed",
    [
        Channel(1, "/other", "cdr", _CHANNEL.metadata, 1),
        Channel(1, "/text", "json", _CHANNEL.metadata, 1),
        Channel(1, "/text", "cdr", _CHANNEL.metadata, 2),
        Channel(1, "/text", "cdr", {"one": "1", "other": "3"}, 1),
        Schema(1, b"string data # \xff", "ros2msg", "std_msgs/msg/String"),
    ],
)
def test_of_two_records_with_one_number_every_field_must_be_equal(changed):
    """As the format demands ("Any two channel records sharing a common ID must be identical")."""
    definitions = Definitions()

    def fault(record):
        content = encoded(record)
        return definitions.add(content[0], content[RECORD_HEAD.size :])

    schema = Schema(1, b"string data", "ros2msg", "std_msgs/msg/String")
    again = Channel(1, "/text", "cdr", dict(reversed(_CHANNEL.metadata.items())), 1)
    assert [fault(each) for each in (schema, _CHANNEL, schema, again)] == [""] * 4
    kind = type(changed).__name__.lower()
    assert fault(changed) == f"{kind} 1 is defined twice, in different ways"
    kept = definitions.channel(1)
    assert (kept.topic, kept.type_name) == ("/text", "std_msgs/msg/String")
