"""Chunks of MCAP files: their heads, also where a chain of records is broken, and their records."""

import re
import struct
import zlib
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import zstandard

from bags.errors import BagError
from bags.formats.limits import LARGEST_CONTENT
from bags.formats.mcap.records import RECORD_HEAD

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
