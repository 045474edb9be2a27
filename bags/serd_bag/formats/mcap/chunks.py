"""Chunks of MCAP files: their heads, also where a chain of records is broken, and their records.

The index behind a chunk, which players trust, is compared with the messages in the chunk.
"""

import re
import struct
import zlib
from array import array
from contextlib import suppress
from io import BytesIO
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT, most_unpacked
from serd_bag.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD
from serd_bag.formats.mcap.window import FileWindow

#: first and last log time, size and checksum of the records, length of the compression's name
_FIELDS = struct.Struct("<QQQII")
_LONGEST_NAME = 16
_SIZE = struct.Struct("<Q")
_PIECE = 1 << 20
#: Bytes of which zstd makes 32 MiB at most.
_ZSTD_PIECE = 1024
#: More bytes than this after the fields of an empty chunk are its records, not an extension.
_LARGEST_EXTENSION = 1024
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

    first_ns: int
    last_ns: int
    size: int
    checksum: int
    compression: str
    data_start: int
    data_size: int


def chunk_head(record: bytes) -> ChunkHead:
    """The head of a chunk record; BagError where it is none."""
    try:
        start = RECORD_HEAD.size
        first_ns, last_ns, size, checksum, name_size = _FIELDS.unpack_from(record, start)
        if name_size > _LONGEST_NAME:
            raise BagError("the head of a chunk is damaged")
        start += _FIELDS.size
        name = record[start : start + name_size].decode("ascii", errors="replace")
        start += name_size
        (data_size,) = _SIZE.unpack_from(record, start)
    except struct.error:
        raise BagError("the head of a chunk is cut off") from None
    return ChunkHead(first_ns, last_ns, size, checksum, name, start + _SIZE.size, data_size)


class ChunkUnpacker:
    """Unpacks the chunks of one file, which all end before `limit`.

    The sizes that a head declares are not relied on. No more bytes in all are tried and unpacked
    than a file of that size may hold.
    """

    def __init__(self, window: FileWindow, limit: int, file_size: int) -> None:
        self._window, self._limit = window, limit
        self._n_left = most_unpacked(file_size)
        self._n_tried = 2 * window.size + LARGEST_CONTENT

    @property
    def may_try(self) -> bool:
        """Whether bytes that may be no chunk are still tried."""
        return self._n_tried > 0

    def unpacked(
        self, head: ChunkHead, offset: int, length: int, *, is_guess: bool
    ) -> tuple[ChunkHead, bytes, int, int]:
        """Unpack the chunk record at `offset`, whose content has `length` bytes.

        Returns the head with the size of the data that is right, bytes, and where in them the
        records begin and end; without compression these are the bytes of the file. The size in the
        head is tried, and that of data that fills the record. Raises BagError where the records
        cannot be unpacked, are too large or do not fit their checksum.
        """
        filling = RECORD_HEAD.size + length - head.data_start
        sizes = {head.data_size, filling}
        if filling > _LARGEST_EXTENSION:
            sizes.discard(0)
        found, fault = None, BagError("a chunk is longer than its record")
        for data_size in sorted(sizes):
            tried = head._replace(data_size=data_size)
            if data_size < 0 or offset + head.data_start + data_size > self._limit:
                continue
            try:
                records = self._records(
                    tried, offset, is_certain=not is_guess and data_size <= filling
                )
            except BagError as error:
                fault = error if data_size == head.data_size else fault
                continue
            found = found or (tried, *records)
            if head.checksum or records[2] - records[1] == head.size:
                return tried, *records
        if found is None:
            raise fault
        return found

    def _records(self, head: ChunkHead, offset: int, *, is_certain: bool) -> tuple[bytes, int, int]:
        """Unpack data of the size in the head; returns bytes, begin and end of the records."""
        size = head.data_start + head.data_size
        if head.data_size > LARGEST_CONTENT:
            raise BagError(f"a chunk must have {LARGEST_CONTENT} bytes at most, got {size}")
        if not is_certain:
            self._n_tried -= size
            if self._n_tried < 0:
                raise BagError("a chunk is longer than its record")
        block, at = self._window.locate(offset, size)
        first = at + head.data_start
        data = memoryview(block)[first : first + head.data_size]
        if len(data) < head.data_size:
            raise BagError("a chunk is longer than its record")
        unpacked = self._unpacked(head, data)
        records = data if unpacked is None else unpacked
        if head.checksum and zlib.crc32(records) != head.checksum:
            raise BagError("the checksum of a chunk does not fit its content")
        if unpacked is None:
            return block, first, first + len(data)
        return unpacked, 0, len(unpacked)

    def _unpacked(self, head: ChunkHead, data: memoryview) -> bytes | None:
        """Decompress the records; returns None if the head names no compression."""
        if head.compression == "":
            return None
        try:
            if head.compression == "zstd":
                return self._unpacked_zstd(head, data)
            if head.compression == "lz4":
                return self._unpacked_lz4(data)
        except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
            raise BagError(f"a chunk cannot be unpacked ({error})") from None
        known = "zstd, lz4 or none"
        raise BagError(f"compression of a chunk must be {known}, got {head.compression!r}")

    def _unpacked_zstd(self, head: ChunkHead, data: memoryview) -> bytes:
        """Decompress at once if the frame or the head has the right size, else in pieces."""
        size = zstandard.frame_content_size(data)
        size = head.size if size < 0 else size
        if 0 < size <= LARGEST_CONTENT:
            self._use(size)
            with suppress(zstandard.ZstdError):
                return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        decompressor = zstandard.ZstdDecompressor().decompressobj()
        records = BytesIO()
        for start in range(0, len(data), _ZSTD_PIECE):
            self._append(records, decompressor.decompress(data[start : start + _ZSTD_PIECE]))
        return _whole(records, decompressor)

    def _unpacked_lz4(self, data: memoryview) -> bytes:
        """Decompress in pieces, since the library copies what it does not take at once."""
        decompressor = lz4.frame.LZ4FrameDecompressor()
        records = BytesIO()
        for start in range(0, len(data), _PIECE):
            piece = bytes(data[start : start + _PIECE])
            while not decompressor.eof:
                part = decompressor.decompress(piece, max_length=_PIECE)
                self._append(records, part)
                piece = b""
                if decompressor.needs_input or not part:
                    break
        return _whole(records, decompressor)

    def _append(self, records: BytesIO, part: bytes) -> None:
        self._use(len(part))
        if records.tell() + len(part) > LARGEST_CONTENT:
            raise BagError(f"a chunk must have {LARGEST_CONTENT} bytes at most, it has more")
        records.write(part)

    def _use(self, n_bytes: int) -> None:
        self._n_left -= n_bytes
        if self._n_left < 0:
            raise BagError("the file unpacks to more than one of its size can hold")


def _whole(records: BytesIO, decompressor: Any) -> bytes:
    if not decompressor.eof:
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
        self._n_indexes = 0

    def begin(self, block: bytes, start: int, end: int, most: int) -> None:
        """Expect an index of the chunk whose records are there; most: records to read."""
        self._expected = _positions(block, start, end, most)

    def add(self, content: bytes) -> None:
        """Take one message index of the chunk; more entries than it has messages are not kept."""
        self._n_indexes += 1
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
        has_index = self._n_indexes > 0
        self._expected, self._found, self._n_found, self._n_indexes = None, [], 0, 0
        if expected is None or not has_index:
            return True
        return n_found == len(expected) and np.array_equal(
            _sorted(np.concatenate([expected[:0], *found])), _sorted(expected)
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
