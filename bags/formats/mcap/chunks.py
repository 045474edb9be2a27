"""Chunks of MCAP files: their heads, also where a chain of records is broken, and their records.

The index behind a chunk, which players trust, is compared with the messages in the chunk.
"""

import re
import struct
import zlib
from array import array
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.errors import BagError
from bags.formats.limits import LARGEST_CONTENT
from bags.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD

#: first and last log time, size and checksum of the records, length of the compression's name
_FIELDS = struct.Struct("<QQQII")
_LONGEST_NAME = 16
_SIZE = struct.Struct("<Q")
_PIECE = 1 << 20
#: Bytes with which a chunk can begin: opcode, length, times, sizes, checksum, compression.
CHUNK_PATTERN = re.compile(
    rb"\x06.{5}\0{3}.{28}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd).{5}\0{3}", re.DOTALL
)
LONGEST_HEAD = RECORD_HEAD.size + _FIELDS.size + _LONGEST_NAME + _SIZE.size
#: channel, size of the entries in bytes; log time, offset
INDEX_HEAD_SIZE = 6
ENTRY_SIZE = 16
_MESSAGE = int(Opcode.MESSAGE)
#: (number of messages, 3): channel, log time, offset in the chunk
_Positions = NDArray[np.uint64]


class ChunkHead(NamedTuple):
    """size, checksum: of the records; data_start, data_size: of them, packed."""

    size: int
    checksum: int
    compression: str
    data_start: int
    data_size: int


def chunk_head(record: bytes) -> ChunkHead:
    """The head of a chunk record; BagError where it is none."""
    try:
        start = RECORD_HEAD.size
        _, _, size, checksum, name_size = _FIELDS.unpack_from(record, start)
        if name_size > _LONGEST_NAME:
            raise BagError("the head of a chunk is damaged")
        start += _FIELDS.size
        name = record[start : start + name_size].decode("ascii", errors="replace")
        start += name_size
        (data_size,) = _SIZE.unpack_from(record, start)
    except struct.error:
        raise BagError("the head of a chunk is cut off") from None
    return ChunkHead(size, checksum, name, start + _SIZE.size, data_size)


def unpack_chunk(head: ChunkHead, block: bytes, at: int) -> tuple[bytes, int]:
    """(bytes, where in them the records begin) of the chunk record at that place of a block.

    Not compressed, they stay where they are. BagError where size or checksum are not as written.
    """
    first = at + head.data_start
    data = memoryview(block)[first : first + head.data_size]
    if len(data) < head.data_size:
        raise BagError("a chunk is longer than its record")
    unpacked = _unpacked(head, data)
    records = data if unpacked is None else unpacked
    if len(records) != head.size:
        raise BagError(f"a chunk must have {head.size} bytes, got {len(records)}")
    if head.checksum and zlib.crc32(records) != head.checksum:
        raise BagError("the checksum of a chunk does not fit its content")
    return (block, first) if unpacked is None else (unpacked, 0)


def _unpacked(head: ChunkHead, data: memoryview) -> bytes | None:
    """The records, at most one byte more than the head declares; None where not compressed."""
    if head.size > LARGEST_CONTENT:
        raise BagError(f"a chunk must have {LARGEST_CONTENT} bytes at most, got {head.size}")
    if head.compression == "":
        return None
    try:
        if head.compression == "zstd":
            return _unpacked_zstd(head, data)
        if head.compression == "lz4":
            return _unpacked_lz4(head, data)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise BagError(f"a chunk cannot be unpacked ({error})") from None
    known = "zstd, lz4 or none"
    raise BagError(f"compression of a chunk must be {known}, got {head.compression!r}")


def _unpacked_zstd(head: ChunkHead, data: memoryview) -> bytes:
    if zstandard.frame_content_size(data) > head.size:
        raise BagError(f"a chunk must unpack to {head.size} bytes, its frame is larger")
    # 0 means no limit.
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(1, head.size))


def _unpacked_lz4(head: ChunkHead, data: memoryview) -> bytes:
    """In pieces: what the library does not take at once it copies at each call."""
    decompressor = lz4.frame.LZ4FrameDecompressor()
    records = BytesIO()
    for start in range(0, len(data), _PIECE):
        piece = bytes(data[start : start + _PIECE])
        while not decompressor.eof and records.tell() <= head.size:
            part = decompressor.decompress(piece, max_length=_PIECE)
            records.write(part)
            piece = b""
            if decompressor.needs_input or not part:
                break
    if not decompressor.eof and records.tell() <= head.size:
        raise BagError("a chunk cannot be unpacked (it ends early)")
    return records.getvalue()


def entries_end(content: bytes) -> int:
    """Where the entries of a message index end, by the size it declares."""
    return INDEX_HEAD_SIZE + int.from_bytes(content[2:INDEX_HEAD_SIZE], "little")


class MessageIndexes:
    """The index records behind one chunk."""

    def __init__(self) -> None:
        self._expected: _Positions | None = None
        self._found: list[_Positions] = []
        self._n_found = 0

    def begin(self, block: bytes, start: int, end: int, most: int) -> None:
        """Expect an index of the chunk whose records are there; most: records to read."""
        self._expected = _positions(block, start, end, most)

    def add(self, content: bytes) -> None:
        """Take one message index of the chunk; more entries than it has messages are not kept."""
        n_entries = max(0, entries_end(content) - INDEX_HEAD_SIZE) // ENTRY_SIZE
        self._n_found += n_entries
        if self._expected is None or self._n_found > len(self._expected):
            return
        entries = np.frombuffer(content, "<u8", 2 * n_entries, INDEX_HEAD_SIZE).reshape(-1, 2)
        channel = int.from_bytes(content[:2], "little")
        self._found.append(np.column_stack([np.full(n_entries, channel, np.uint64), entries]))

    def fit(self) -> bool:
        """Whether each message is listed where it is; the next chunk may then be added.

        A chunk without any index is as good: the format leaves them to the writer.
        """
        expected, found, n_found = self._expected, self._found, self._n_found
        self._expected, self._found, self._n_found = None, [], 0
        if expected is None or not n_found:
            return True
        return n_found == len(expected) and np.array_equal(
            _sorted(np.concatenate(found)), _sorted(expected)
        )


def _sorted(positions: _Positions) -> _Positions:
    return positions[np.lexsort(positions.T)]


def _positions(block: bytes, start: int, end: int, most: int) -> _Positions:
    """(channel, log time, offset) of each message."""
    found = array("Q")
    offset = start
    for _ in range(most):
        if offset + RECORD_HEAD.size > end:
            break
        opcode, length = RECORD_HEAD.unpack_from(block, offset)
        following = offset + RECORD_HEAD.size + length
        if opcode == _MESSAGE and offset + MESSAGE_HEAD.size <= following <= end:
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(block, offset)
            found.extend((channel, log_time, offset - start))
        offset = following
    return np.frombuffer(found, np.uint64).reshape(-1, 3)
