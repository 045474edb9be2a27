"""MCAP files of the writer of `mcap`, in all forms that the format allows, are read completely."""

import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, IndexType, Writer

from serd_bag.formats.mcap.definitions import Definitions
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.reader import BagReader

OPTIONS = [
    {},
    {"use_chunking": False},
    {"repeat_channels": False, "repeat_schemas": False},
    {"use_statistics": False, "index_types": IndexType.NONE},
    {"enable_crcs": False},
]


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("options", OPTIONS)
def test_files_of_every_form_are_sound(tmp_path, compression, options):
    path = tmp_path / "their.mcap"
    written = [b"\0\1\0\0" + bytes([number % 256]) * 50 for number in range(300)]
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=2000, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/text", "cdr", schema)
        for number, data in enumerate(written):
            writer.add_message(channel, log_time=number, data=data, publish_time=number + 1)
        writer.finish()
    reader = BagReader(path, thorough=True)
    found = list(reader.messages())
    assert [message.data for message in found] == written
    assert {message[:2] for message in found} == {("/text", "std_msgs/msg/String")}
    assert [message[3:] for message in found] == [(n, n + 1) for n in range(300)]
    assert list(reader.topics) == ["/text"]


FIRST = Channel(1, "/text", "cdr", {"one": "1", "other": "2"}, 1)
SCHEMA = Schema(1, b"string data", "ros2msg", "std_msgs/msg/String")


def noted(definitions, record):
    """What `Definitions` finds wrong with the record."""
    builder = RecordBuilder()
    record.write(builder)
    opcode = Opcode.CHANNEL if isinstance(record, Channel) else Opcode.SCHEMA
    return definitions.add(opcode, builder.end()[RECORD_HEAD.size :])


@pytest.mark.parametrize(
    "changed",
    [
        Channel(1, "/other", "cdr", FIRST.metadata, 1),
        Channel(1, "/text", "json", FIRST.metadata, 1),
        Channel(1, "/text", "cdr", FIRST.metadata, 2),
        Channel(1, "/text", "cdr", {"one": "1", "other": "3"}, 1),
        Schema(1, b"string data # \xff", "ros2msg", "std_msgs/msg/String"),
    ],
)
def test_of_two_records_with_one_number_every_field_must_be_equal(changed):
    """As the format demands ("Any two channel records sharing a common ID must be identical")."""
    definitions = Definitions()
    again = Channel(1, "/text", "cdr", dict(reversed(FIRST.metadata.items())), 1)
    assert [noted(definitions, each) for each in (SCHEMA, FIRST, SCHEMA, again)] == [""] * 4
    kind = type(changed).__name__.lower()
    assert noted(definitions, changed) == f"{kind} 1 is defined twice, in different ways"
    assert definitions.names(1) == ("/text", "std_msgs/msg/String")
