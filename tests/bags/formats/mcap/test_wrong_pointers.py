"""No offset, length, count or number of an MCAP file hides a message where it is wrong.

Each field that points or counts gets several wrong values: places where nothing or another record
begins, places beyond the end, and numbers near the right one. The checksum of the summary is
written anew, or left out, so that nothing but the wrong value is wrong.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import pytest
from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import CompressionType, IndexType, Writer

from serd_bag.command.main import main
from serd_bag.command.rewrite import convert, recover
from serd_bag.errors import BagError
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from support.damaged_files import write_wrong

N_MESSAGES = 12
COUNTS = {"/text": 8, "/other": 4}


def file_with(path, **options):
    """A file of the official writer: three chunks, two channels, an attachment and metadata."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=190, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        text, other = (writer.register_channel(name, "cdr", schema) for name in COUNTS)
        for number in range(N_MESSAGES):
            channel, data = text if number % 3 else other, b"\0\1\0\0" + bytes([number]) * 20
            writer.add_message(channel, log_time=number + 1, data=data, publish_time=number)
            if number == 5:
                writer.add_attachment(1, 2, "map.yaml", "text/yaml", b"resolution: 0.05")
                writer.add_metadata("robot", {"name": "one"})
        writer.finish()
    return path


class Field(NamedTuple):
    """A number in a file: its name, place and size in bytes."""

    name: str
    place: int
    size: int


def records(content):
    """(opcode, where its content begins) of each record of a file."""
    offset = MAGIC_SIZE
    while offset < len(content) - MAGIC_SIZE:
        opcode, length = RECORD_HEAD.unpack_from(content, offset)
        yield opcode, offset + RECORD_HEAD.size
        offset += RECORD_HEAD.size + length


#: (name, size) of the numbers with which the records begin; None for bytes that are no such number.
_BEGINNINGS = {
    Opcode.SCHEMA: [("id", 2)],
    Opcode.CHANNEL: [("id", 2), ("schema", 2)],
    Opcode.CHUNK_INDEX: [(None, 16), ("start", 8), ("length", 8)],
    Opcode.ATTACHMENT_INDEX: [("offset", 8), ("length", 8), (None, 16), ("data size", 8)],
    Opcode.METADATA_INDEX: [("offset", 8), ("length", 8)],
    Opcode.STATISTICS: [
        *(("messages", 8), ("schemas", 2), ("channels", 4), ("attachments", 4), ("metadata", 4)),
        ("chunks", 4),
    ],
    Opcode.SUMMARY_OFFSET: [("group", 1), ("start", 8), ("length", 8)],
    Opcode.FOOTER: [("summary start", 8), ("offset start", 8)],
}
#: Where in the content the size of a list of (channel, place or count) stands.
_LISTS = {Opcode.CHUNK_INDEX: 32, Opcode.STATISTICS: 42}


def fields_of_summary(content: bytes) -> Iterator[Field]:
    """The fields of the summary and the footer that point, count or number."""
    in_summary = False
    for opcode, start in records(content):
        name = Opcode(opcode).name.lower()
        place = start
        for field, size in _BEGINNINGS.get(opcode, ()) if in_summary else ():
            if field:
                yield Field(f"{name} {field}", place, size)
            place += size
        if opcode in _LISTS:
            place = start + _LISTS[opcode] + 4
            (size,) = struct.unpack_from("<I", content, place - 4)
            for pair in range(place, place + size, 10):
                yield Field(f"{name} channel", pair, 2)
                yield Field(f"{name} of a channel", pair + 2, 8)
            place += size
        if opcode == Opcode.CHUNK_INDEX:
            yield Field("chunk_index length of indexes", place, 8)
            (size,) = struct.unpack_from("<I", content, place + 8)
            yield Field("chunk_index packed size", place + 12 + size, 8)
            yield Field("chunk_index size", place + 20 + size, 8)
        in_summary |= opcode == Opcode.DATA_END


def wrong_values(content, field):
    """Wrong values of a field: places of all kinds, and numbers near the right one."""
    right = int.from_bytes(content[field.place :][: field.size], "little")
    starts = [start - RECORD_HEAD.size for _, start in records(content)]
    places = (0, MAGIC_SIZE, starts[1] + 20, starts[2], starts[-2])
    values = {
        *places,
        len(content),
        len(content) + 1000,
        right + 1,
        right - 1,
        2 ** (8 * field.size) - 1,
    }
    return sorted({value % 256**field.size for value in values} - {right})


def changed(content, field, value, *, checksum):
    """The content with another value of a field, the summary under a new checksum or none."""
    found = bytearray(content)
    found[field.place : field.place + field.size] = value.to_bytes(field.size, "little")
    footer = len(found) - MAGIC_SIZE - RECORD_HEAD.size - 20
    (start,) = struct.unpack_from("<Q", found, footer + RECORD_HEAD.size)
    digest = zlib.crc32(found[start or footer : -MAGIC_SIZE - 4]) if checksum else 0
    found[-MAGIC_SIZE - 4 : -MAGIC_SIZE] = digest.to_bytes(4, "little")
    return bytes(found)


def assert_all_messages_are_found(path, target):
    """By each command that reads damaged files; the others name the fault and the command."""
    by_topic = {topic.name: topic.n_messages for topic in contents_of_bag(path).topics}
    check = check_bag(path)
    assert by_topic == {topic.name: topic.n_messages for topic in check.topics} == COUNTS
    assert not check.sound
    assert len(list(BagReader(path, tolerant=True).messages())) == N_MESSAGES
    report = recover(path, target)
    assert report.counts == COUNTS
    assert report.damage
    with pytest.raises(BagError, match="repair it with 'serd bag recover'"):
        convert(path, target.with_name("converted"))


@pytest.mark.slow
@pytest.mark.parametrize("checksum", [True, False])
def test_no_wrong_number_in_the_summary_hides_a_message(tmp_path, checksum):
    path = file_with(tmp_path / "file.mcap", compression=CompressionType.NONE)
    content = path.read_bytes()
    names = Counter()
    for field in fields_of_summary(content):
        for number, value in enumerate(wrong_values(content, field)):
            path.write_bytes(changed(content, field, value, checksum=checksum))
            names[field.name] += 1
            assert_all_messages_are_found(path, tmp_path / f"{field.place}-{number}")
    assert len(names) == 28
    assert names.total() > 400


def test_a_pointer_to_the_beginning_of_a_file_without_summary_hides_nothing(tmp_path, capsys):
    options = {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False}
    options |= {"index_types": IndexType.NONE, "use_summary_offsets": False, "enable_crcs": False}
    path = file_with(tmp_path / "file.mcap", compression=CompressionType.LZ4, **options)
    content = path.read_bytes()
    start = next(
        field for field in fields_of_summary(content) if field.name == "footer summary start"
    )
    assert content[start.place : start.place + 8] == bytes(8)
    path.write_bytes(changed(content, start, MAGIC_SIZE, checksum=False))
    assert_all_messages_are_found(path, tmp_path / "first")
    (fault,) = check_bag(path).faults
    assert "the footer points to byte 8, where no summary begins" in fault
    assert main(["recover", str(path), "--output", str(tmp_path / "second")]) == 0
    assert "second: 12 messages\n" in capsys.readouterr().out
    assert main(["convert", str(tmp_path / "second"), "--output", str(tmp_path / "third")]) == 0
    assert len(list(BagReader(tmp_path / "third").messages())) == N_MESSAGES


def test_a_footer_that_names_no_summary_where_there_is_one_hides_nothing(tmp_path):
    path = file_with(tmp_path / "file.mcap", compression=CompressionType.NONE)
    content = path.read_bytes()
    start = next(
        field for field in fields_of_summary(content) if field.name == "footer summary start"
    )
    path.write_bytes(changed(content, start, 0, checksum=True))
    assert any("the footer names no summary" in fault for fault in check_bag(path).faults)


@pytest.mark.parametrize("checksums", [True, False])
@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize(("name", "at"), [("size", 16), ("data size", -8), ("length", -9)])
def test_no_wrong_size_of_a_chunk_hides_a_message(tmp_path, name, at, compression, checksums):
    """at: place of the size, from the beginning or, below 0, from the data of the chunk."""
    path = file_with(tmp_path / "file.mcap", compression=compression, enable_crcs=checksums)
    content = path.read_bytes()
    _, start = [each for each in records(content) if each[0] == Opcode.CHUNK][1]
    (name_size,) = struct.unpack_from("<I", content, start + 28)
    place = {"size": start + at, "data size": start + 40 + name_size + at, "length": start - 8}[
        name
    ]
    for value in wrong_values(content, Field(name, place, 8)):
        write_wrong(path, content, place, value.to_bytes(8, "little"))
        assert len(list(BagReader(path, tolerant=True).messages())) == N_MESSAGES
        assert not check_bag(path).sound


@pytest.mark.parametrize("record", [Opcode.HEADER, Opcode.SCHEMA, Opcode.ATTACHMENT])
def test_a_wrong_length_of_a_record_in_a_file_without_chunks_hides_no_message(tmp_path, record):
    path = file_with(tmp_path / "file.mcap", use_chunking=False)
    content = path.read_bytes()
    _, start = next(each for each in records(content) if each[0] == record)
    for value in wrong_values(content, Field("length", start - 8, 8)):
        write_wrong(path, content, start - 8, value.to_bytes(8, "little"))
        check = check_bag(path)
        assert {topic.name: topic.n_messages for topic in check.topics} == COUNTS
        assert not check.sound


def test_a_wrong_length_of_a_message_outside_of_chunks_costs_at_most_itself(tmp_path):
    path = file_with(tmp_path / "file.mcap", use_chunking=False)
    content = path.read_bytes()
    whole = {message.data for message in BagReader(path).messages()}
    for _, start in [each for each in records(content) if each[0] == Opcode.MESSAGE]:
        for value in wrong_values(content, Field("length", start - 8, 8)):
            write_wrong(path, content, start - 8, value.to_bytes(8, "little"))
            reader = BagReader(path, tolerant=True)
            assert len(whole - {message.data for message in reader.messages()}) <= 1
            assert reader.damage


def test_contents_are_those_of_the_messages_where_the_statistics_are_wrong_alike(tmp_path):
    """The numbers of all messages and of a channel agree with each other, not with the index."""
    path = file_with(tmp_path / "file.mcap", compression=CompressionType.NONE)
    content = path.read_bytes()
    fields = [each for each in fields_of_summary(content) if each.name.startswith("statistics")]
    wrong = changed(content, fields[0], 11, checksum=True)
    of_channel = next(each for each in fields if each.name == "statistics of a channel")
    path.write_bytes(changed(wrong, of_channel, 7, checksum=True))
    assert {topic.name: topic.n_messages for topic in contents_of_bag(path).topics} == COUNTS


def test_of_a_channel_that_is_defined_in_two_ways_the_one_of_the_summary_counts(tmp_path):
    path = file_with(tmp_path / "file.mcap", use_chunking=False, enable_crcs=False)
    content = path.read_bytes()
    _, start = next(each for each in records(content) if each[0] == Opcode.CHANNEL)
    write_wrong(path, content, start, b"\2\0")
    check = check_bag(path)
    assert {topic.name: topic.n_messages for topic in check.topics} == COUNTS
    assert any("channel 2 is defined twice, in different ways" in each for each in check.faults)
