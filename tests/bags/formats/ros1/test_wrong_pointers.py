"""No offset, length, count or number of a .bag file hides a message where it is wrong."""

import re
import struct
from collections import Counter

import pytest
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

from serd_bag.command.main import main
from serd_bag.errors import BagError
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from support.damaged_files import counts_of, write_flipped, write_wrong, wrong_numbers

TEXT, NUMBER = "std_msgs/msg/String", "std_msgs/msg/Int32"
COUNTS = {"/text": 16, "/number": 8}
N_MESSAGES = sum(COUNTS.values())
MAGIC = b"#ROSBAG V2.0\n"
INDEX, CHUNK, CHUNK_INFO, CONNECTION = 4, 5, 6, 7
COMPRESSIONS = [None, *Writer.CompressionFormat]


def file_with(path, compression=None):
    """Five chunks of messages on two topics."""
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    writer.chunk_threshold = 300
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        text = writer.add_connection("/text", TEXT, typestore=store)
        number = writer.add_connection("/number", NUMBER, typestore=store)
        for step in range(N_MESSAGES):
            kind, value = (TEXT, f"text {step:4}") if step % 3 else (NUMBER, step)
            data = store.serialize_ros1(store.types[kind](value), kind)
            writer.write(text if step % 3 else number, 10**18 + step, data)
    return path


def records(content):
    """(begin, places and sizes of the fields, opcode, begin and end of the data) of each record."""
    offset = len(MAGIC)
    while offset < len(content):
        (size,) = struct.unpack_from("<I", content, offset)
        place, start, fields = offset + 4, offset + 8 + size, {}
        while place < start - 4:
            (length,) = struct.unpack_from("<I", content, place)
            name, _, value = content[place + 4 : place + 4 + length].partition(b"=")
            fields[name.decode()] = (place + 5 + len(name), len(value))
            place += 4 + length
        (data_size,) = struct.unpack_from("<I", content, start - 4)
        yield offset, fields, content[fields["op"][0]], start, start + data_size
        offset = start + data_size


def fields_of(content):
    """(name, place, size) of the numbers that point, count or number."""
    for offset, fields, opcode, start, end in records(content):
        names = ["index_pos", "conn_count", "chunk_count", "chunk_pos", "size"]
        names += ["conn", "count"] * (opcode in (INDEX, CHUNK_INFO, CONNECTION))
        for name in fields.keys() & set(names):
            yield f"{opcode} {name}", *fields[name]
        for place in range(start, end, 4) if opcode == CHUNK_INFO else ():
            yield "6 connection or count", place, 4
        if opcode == INDEX:
            yield "4 time of a message", start, 4
            yield "4 length of the header", offset, 4
        if opcode in (INDEX, CHUNK):
            yield f"{opcode} length", start - 4, 4


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_no_wrong_number_hides_a_message(tmp_path, compression):
    path = file_with(tmp_path / "file.bag", compression)
    content = path.read_bytes()
    assert check_bag(path).sound
    names, starts = set(), [start for start, *_ in records(content)]
    for name, place, size in fields_of(content):
        names.add(name)
        right = int.from_bytes(content[place : place + size], "little")
        for value in wrong_numbers(content, starts, right, size):
            write_wrong(path, content, place, value.to_bytes(size, "little"))
            check = check_bag(path)
            assert (counts_of(check), check.sound) == (COUNTS, False), name
            if name == "3 index_pos" and value == 8:
                assert "points to byte 8 as the index, which begins at" in check.faults[0]
                assert counts_of(contents_of_bag(path)) == COUNTS
                assert counts_of(rescue(path, tmp_path / "new")) == COUNTS
    assert len(names) == 14


@pytest.mark.parametrize("words", [b"/text", b"type=std_msgs/String", b"string data"])
def test_a_connection_that_is_defined_in_two_ways_loses_no_message(tmp_path, words):
    """It stands in a chunk and in the index."""
    path = file_with(tmp_path / "file.bag")
    content = path.read_bytes()
    verdicts = []
    for at in re.finditer(words, content):
        write_flipped(path, content, at.start() + 2, 4)
        check = check_bag(path)
        assert check.n_messages == contents_of_bag(path).n_messages == N_MESSAGES
        assert rescue(path, tmp_path / f"new_{at.start()}").n_messages == N_MESSAGES
        verdicts.append(check.sound)
    assert verdicts.count(False) == 2  # the topic in the header of a connection is not used


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_killed_recorder_loses_no_chunk_that_is_complete(tmp_path, compression):
    """Its file has no index, and its bag header does not point to one."""
    path = file_with(tmp_path / "file.bag", compression)
    content, whole = path.read_bytes(), list(BagReader(path).messages())
    begins = next(offset for offset, _, opcode, *_ in records(content) if opcode == CONNECTION)
    _, place, _ = next(each for each in fields_of(content) if each[0] == "3 index_pos")
    path.write_bytes(content[:place] + bytes(8) + content[place + 8 : begins])
    reader = BagReader(path, tolerant=True)
    assert list(reader.messages()) == whole
    assert [each.what for each in reader.damage] == ["it has no index: its recorder was killed"]
    path.write_bytes(path.read_bytes()[:-400])
    found = list(BagReader(path, tolerant=True).messages())
    assert found == whole[: len(found)]
    assert len(found) >= len(whole) - 12


def test_of_a_chunk_that_is_not_finished_or_broken_all_else_is_read(tmp_path):
    path = file_with(tmp_path / "file.bag")
    content, whole = path.read_bytes(), list(BagReader(path).messages())
    chunks = [each for each in records(content) if each[2] == CHUNK]
    # Behind a broken record reading goes on by the index of the chunk.
    write_wrong(path, content, chunks[1][3], b"\xff" * 4)
    reader = BagReader(path, tolerant=True)
    found = list(reader.messages())
    assert set(found) < set(whole)
    assert len(whole) - len(found) == reader.losses.n_messages == 1
    assert main(["rescue", str(path), "--output", str(tmp_path / "new")]) == 1
    # A chunk that a killed recorder had begun states no size.
    _, fields, _, start, end = chunks[-1]
    place, size = fields["size"]
    begun = content[:place] + bytes(size) + content[place + size : start - 4] + bytes(4)
    for n_cut in (0, 1):
        path.write_bytes(begun + content[start : end - 5 * n_cut])
        found = list(BagReader(path, tolerant=True).messages())
        assert found == whole[: len(whole) - n_cut]


def chunks_of(path):
    """(place of its head, of its content and of its index, messages) of each chunk."""
    with Reader(path) as sound:
        return [
            (each.pos, chunk.datapos, chunk.datapos + chunk.datasize, sum(counts.values()))
            for each, chunk in zip(sound.chunk_infos, sound.chunks.values(), strict=True)
            for counts in [each.connection_counts]
        ]


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("part", ["head", "compression", "content", "index"])
def test_a_damaged_chunk_costs_its_own_messages(tmp_path, compression, part):
    path = file_with(tmp_path / "file.bag", compression)
    whole, content = [each.data for each in BagReader(path).messages()], path.read_bytes()
    chunks = chunks_of(path)
    assert len(chunks) == 5
    for head, start, index, n_messages in (chunks[0], chunks[3], chunks[-1]):
        middle = start + (index - start) // 2
        place = {"head": head, "compression": head + 10, "content": middle, "index": index + 55}
        write_wrong(path, content, place[part], b"\xff" * 4)
        reader = BagReader(path, tolerant=True)
        found = [each.data for each in reader.messages()]
        assert (Counter(whole) - Counter(found)).total() <= n_messages
        assert reader.losses.n_messages == len(whole) - len(found)
        # Without checksums a number in a message may be another.
        assert reader.damage or set(found) - set(whole)
        if reader.damage:
            assert reader.damage[0].offset == head
            with pytest.raises(BagError, match=r"a chunk is damaged .* with 'serd-bag resc"):
                list(BagReader(path).messages())


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_of_a_chunk_no_more_is_unpacked_than_the_limit(tmp_path, monkeypatch, compression):
    path = file_with(tmp_path / "file.bag", compression)
    monkeypatch.setattr("serd_bag.formats.ros1.scan.LARGEST_CONTENT", 200)
    monkeypatch.setattr("serd_bag.formats.ros1.scan.MOST_PACKED", 0)
    reader = BagReader(path, tolerant=True)
    assert (len(list(reader.messages())) < sum(COUNTS.values())) == bool(compression)
    assert bool(reader.damage) == bool(compression)
    assert any("has no checksums" in remark for remark in check_bag(path).remarks)
