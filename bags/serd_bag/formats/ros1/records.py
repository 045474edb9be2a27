"""Records of .bag files of ROS 1: a header of named fields and data, each after its length.

Format 2.0: a bag header, chunks that hold connections and messages, behind each chunk the index of
its messages by connection, and at the end connections and an entry for each chunk. Bytes of a file
may be anything; what is no record is a BagError.
"""

import bz2
import re
import struct
from typing import NamedTuple

import lz4.frame
import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1.reader import normalize
from rosbags.typesys.msg import normalize_msgtype

from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_DEFINITION

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
KINDS = range(MESSAGE, CONNECTION + 1)
#: Bytes in the header of a chunk.
CHUNK_PATTERN = re.compile(rb"\x04\0{3}op=\x05")
LONGEST_CHUNK_HEAD = 128
_SIZE = struct.Struct("<I")
_TIME = struct.Struct("<II")
_SECOND_NS = 1_000_000_000
#: time in s and ns, offset in the chunk
_ENTRY = np.dtype([("s", "<u4"), ("ns", "<u4"), ("offset", "<u4")])
#: connection, number of messages
_COUNT = np.dtype([("connection", "<u4"), ("count", "<u4")])
#: connection, time in ns, offset in the chunk
Entry = tuple[int, int, int]


class Record(NamedTuple):
    """One record: the fields of its header, and where its data starts and ends."""

    fields: dict[bytes, bytes]
    start: int
    end: int

    @property
    def kind(self) -> int:
        """The opcode."""
        return self.number(b"op")

    def number(self, name: bytes) -> int:
        """Return the whole number in a field; raises BagError if there is none."""
        value = self.fields.get(name, b"")
        if not 0 < len(value) <= _TIME.size:
            raise BagError(f"a record lacks the number {name.decode()}")
        return int.from_bytes(value, "little")

    def time_ns(self) -> int:
        """Return the time in the header; raises BagError if there is none."""
        number = self.number(b"time")
        return (number & 0xFFFFFFFF) * _SECOND_NS + (number >> 32)


class Connection(NamedTuple):
    """A topic, its type under its name in ROS 2, and the text of its definition."""

    topic: str
    type_name: str
    definition: str


def header_size(block: bytes) -> int:
    """Return how many bytes the header of a record and its two lengths have."""
    if len(block) < _SIZE.size:
        raise BagError("a record is cut off")
    (size,) = _SIZE.unpack_from(block)
    if size > LARGEST_DEFINITION:
        raise BagError(f"no record begins with {block[: _SIZE.size].hex(' ')}")
    return int(size) + 2 * _SIZE.size


def record_at(block: bytes, at: int, end: int) -> Record:
    """Read the record at that place of a block; its data may end beyond the block.

    Raises BagError if no record with a whole header begins there.
    """
    try:
        (size,) = _SIZE.unpack_from(block, at)
        start = at + _SIZE.size + size
        if start + _SIZE.size > end:
            raise BagError("a record is cut off")
        fields = _fields(block, at + _SIZE.size, start)
        (data_size,) = _SIZE.unpack_from(block, start)
    except struct.error:
        raise BagError("a record is cut off") from None
    found = Record(fields, start + _SIZE.size, start + _SIZE.size + data_size)
    if len(found.fields.get(b"op", b"")) != 1:
        raise BagError("a record has no opcode")
    return found


def _fields(block: bytes, at: int, end: int) -> dict[bytes, bytes]:
    found = {}
    while at < end:
        (size,) = _SIZE.unpack_from(block, at)
        at += _SIZE.size
        name, separator, value = block[at : at + size].partition(b"=")
        at += size
        if at > end or not separator:
            raise BagError("the header of a record is damaged")
        found[name] = value
    return found


def connection_of(record: Record, data: bytes) -> tuple[int, Connection]:
    """Read a connection record; returns its number and the connection, or raises BagError."""
    try:
        fields = _fields(data, 0, len(data))
        topic = record.fields[b"topic"].decode()
        kind, text = (fields[name].decode() for name in (b"type", b"message_definition"))
        found = Connection("/" + normalize(topic).lstrip("/"), normalize_msgtype(kind), text)
    except (KeyError, ValueError, IndexError, struct.error):
        raise BagError("a connection record is damaged") from None
    return record.number(b"conn"), found


def counts_of(record: Record, data: bytes) -> tuple[int, dict[int, int]]:
    """Read the entry of a chunk; returns the place of the chunk and its messages by connection."""
    rows = np.frombuffer(data[: len(data) // _COUNT.itemsize * _COUNT.itemsize], _COUNT)
    counts = dict(zip(rows["connection"].tolist(), rows["count"].tolist(), strict=True))
    return record.number(b"chunk_pos"), counts


def entries_of(record: Record, data: bytes) -> list[Entry] | None:
    """Read an index record; returns None if it has another number of entries than it states."""
    try:
        connection, count = record.number(b"conn"), record.number(b"count")
    except BagError:
        return None
    if len(data) != count * _ENTRY.itemsize:
        return None
    rows: NDArray[np.void] = np.frombuffer(data, _ENTRY)
    time_ns = rows["s"].astype(np.int64) * _SECOND_NS + rows["ns"]
    return [
        (connection, *each) for each in zip(time_ns.tolist(), rows["offset"].tolist(), strict=True)
    ]


def unpacked_chunk(
    record: Record, block: bytes, at: int, size: int, most: int
) -> tuple[bytes, int, int]:
    """Unpack the data of a chunk at that place of a block, up to `most` bytes.

    Returns bytes, and where in them the records begin and end; without compression these are the
    block. Raises BagError if the data cannot be unpacked.
    """
    compression = record.fields.get(b"compression", b"").decode(errors="replace")
    if compression == "none":
        return block, at, min(at + size, len(block))
    try:
        if compression == "bz2":
            unpacked = bz2.BZ2Decompressor().decompress(block[at : at + size], most)
        elif compression == "lz4":
            unpacked = lz4.frame.LZ4FrameDecompressor().decompress(block[at : at + size], most)
        else:
            raise BagError(f"its compression must be none, bz2 or lz4, got {compression!r}")
    except (OSError, ValueError, RuntimeError, EOFError) as error:
        raise BagError(str(error).strip().rstrip(".") or type(error).__name__) from None
    return unpacked, 0, len(unpacked)
