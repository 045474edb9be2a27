"""No offset, length, count or number of an MCAP file hides a message where it is wrong.

Each field that points or counts gets several wrong values: places where nothing or another record
begins, places beyond the end, and numbers near the right one. The checksum of the summary is
written anew, or left out, so that nothing but the wrong value is wrong.
"""

import struct
import zlib
from contextlib import suppress
from dataclasses import asdict, replace
from io import BytesIO

import pytest
from mcap.opcode import Opcode
from mcap.records import Footer
from mcap.stream_reader import MAGIC_SIZE, StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, IndexType

from serd_bag.command.rewrite import convert
from serd_bag.errors import BagError
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from support.damaged_files import counts_of, write_wrong, wrong_numbers
from support.mcap_files import encoded, records, write_official

N_MESSAGES = 12
COUNTS = {"/text": 8, "/other": 4}


def file_with(path, **options):
    """Three chunks, two channels, an attachment and metadata."""
    write_official(path, ["/other", "/text", "/text"], N_MESSAGES, chunk_size=190, **options)
    return path.read_bytes()


def wrong_values(content, right):
    return wrong_numbers(
        content, [start - RECORD_HEAD.size for _, start in records(content)], right
    )


def changed(record, content):
    """(name of the field, record with a wrong value in it) of each field that points or counts."""
    for name, value in asdict(record).items():
        if isinstance(value, dict) and all(isinstance(key, int) for key in value):
            for key, right in value.items():
                others = {each: value[each] for each in value if each != key}
                for wrong in wrong_values(content, right):
                    yield f"{name} of a channel", replace(record, **{name: {**others, key: wrong}})
                for wrong in {0, key + 7, 2**16 - 1} - value.keys():
                    yield f"channel of {name}", replace(record, **{name: {**others, wrong: right}})
        elif isinstance(value, int) and not ("time" in name or "crc" in name):
            for wrong in wrong_values(content, value):
                yield name, replace(record, **{name: wrong})


def with_wrong_numbers(content):
    """(kind and field, content with one wrong number) for the records of the summary."""
    data_end = max(start for opcode, start in records(content) if opcode == Opcode.DATA_END)
    begin = data_end + 4
    summary = list(StreamReader(BytesIO(MCAP0_MAGIC + content[begin:]), skip_magic=False).records)
    for number, record in enumerate(summary):
        for name, wrong in changed(record, content):
            try:
                parts = [encoded(each) for each in (*summary[:number], wrong)]
            except struct.error:  # a number of fewer bytes
                continue
            parts += [encoded(each) for each in summary[number + 1 :]]
            yield f"{type(record).__name__}.{name}", content[:begin] + b"".join(parts) + MCAP0_MAGIC


def sealed(content, *, checksum):
    """The content with a new checksum of the summary, or none."""
    footer = len(content) - MAGIC_SIZE - RECORD_HEAD.size - 20
    (start,) = struct.unpack_from("<Q", content, footer + RECORD_HEAD.size)
    digest = zlib.crc32(content[start or footer : -MAGIC_SIZE - 4]) if checksum else 0
    return content[: -MAGIC_SIZE - 4] + digest.to_bytes(4, "little") + MCAP0_MAGIC


def assert_all_messages_are_found(path, name=""):
    check = check_bag(path)
    assert counts_of(contents_of_bag(path)) == counts_of(check) == COUNTS, name
    assert not check.sound, name
    assert len(list(BagReader(path, tolerant=True).messages())) == N_MESSAGES


def assert_rescued_and_converted(path, target):
    """A wrong number or definition is a reason not to convert; wrong places are none."""
    report = rescue(path, target)
    assert (counts_of(report), bool(report.damage)) == (COUNTS, True)
    with suppress(BagError):
        assert convert(path, target.with_name(f"{target.name}_converted")).counts == COUNTS


def test_no_wrong_number_in_the_summary_hides_a_message(tmp_path):
    path = tmp_path / "file.mcap"
    content = file_with(path, compression=CompressionType.NONE)
    n_cases, names = 0, set()
    for n_cases, (name, wrong) in enumerate(with_wrong_numbers(content), start=1):
        path.write_bytes(sealed(wrong, checksum=n_cases % 2 > 0))
        assert_all_messages_are_found(path, name)
        if name not in names:
            assert_rescued_and_converted(path, tmp_path / f"recovered_{n_cases}")
        names.add(name)
    assert len(names) == 28
    assert n_cases > 400


def test_a_pointer_to_the_beginning_of_a_file_without_summary_hides_nothing(tmp_path):
    options = {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False}
    options |= {"index_types": IndexType.NONE, "use_summary_offsets": False, "enable_crcs": False}
    path = tmp_path / "file.mcap"
    content = file_with(path, compression=CompressionType.LZ4, **options)
    footer = encoded(Footer(MAGIC_SIZE, 0, 0))
    path.write_bytes(content[: -len(footer) - MAGIC_SIZE] + footer + MCAP0_MAGIC)
    assert_all_messages_are_found(path)
    assert_rescued_and_converted(path, tmp_path / "recovered")
    (fault,) = check_bag(path).faults
    assert "the footer points to byte 8, where no summary begins" in fault


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize(("name", "at"), [("size", 16), ("data size", -8), ("length", -9)])
def test_no_wrong_size_of_a_chunk_hides_a_message(tmp_path, name, at, compression):
    """at: place of the size, from the beginning or, below 0, from the data of the chunk."""
    path = tmp_path / "file.mcap"
    for checksums in (True, False):
        content = file_with(path, compression=compression, enable_crcs=checksums)
        _, start = [each for each in records(content) if each[0] == Opcode.CHUNK][1]
        (name_size,) = struct.unpack_from("<I", content, start + 28)
        data = start + 40 + name_size
        place = {"size": start + at, "data size": data + at, "length": start - 8}[name]
        for value in wrong_values(content, *struct.unpack_from("<Q", content, place)):
            write_wrong(path, content, place, value.to_bytes(8, "little"))
            assert len(list(BagReader(path, tolerant=True).messages())) == N_MESSAGES
            assert not check_bag(path).sound


@pytest.mark.parametrize("record", ["HEADER", "SCHEMA", "ATTACHMENT", "MESSAGE"])
def test_a_wrong_length_of_a_record_outside_of_chunks_costs_at_most_its_message(tmp_path, record):
    path = tmp_path / "file.mcap"
    content = file_with(path, use_chunking=False)
    starts = [start for opcode, start in records(content) if opcode == Opcode[record]]
    for start in starts if record == "MESSAGE" else starts[:1]:
        for value in wrong_values(content, *struct.unpack_from("<Q", content, start - 8)):
            write_wrong(path, content, start - 8, value.to_bytes(8, "little"))
            check = check_bag(path)
            assert check.n_messages >= N_MESSAGES - (record == "MESSAGE")
            assert not check.sound


def test_of_a_channel_that_is_defined_in_two_ways_the_one_of_the_summary_counts(tmp_path):
    path = tmp_path / "file.mcap"
    content = file_with(path, use_chunking=False, enable_crcs=False)
    _, start = next(each for each in records(content) if each[0] == Opcode.CHANNEL)
    write_wrong(path, content, start, b"\2\0")
    check = check_bag(path)
    assert counts_of(check) == COUNTS
    assert any("channel 2 is defined twice, in different ways" in each for each in check.faults)
