"""The inside of an MCAP chunk: checked, unpacked, record by record."""

import struct
import zlib
from collections.abc import Iterator

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from bags.errors import BagError
from bags.mcap.format import MESSAGE, MESSAGE_RECORD_HEAD, RECORD_HEAD, Cursor

_LARGEST_UNPACKED = 1 << 30


def unpacked_chunk(content: bytes) -> bytes:
    """The records of a chunk record; BagError where size or checksum are not as written."""
    try:
        cursor = Cursor(content)
        _, _, size, checksum = cursor.numbers("QQQI")
        compression = cursor.text()
        packed = cursor.raw(wide=True)
    except (struct.error, UnicodeError) as error:
        raise BagError(f"the head of a chunk is damaged ({error})") from None
    if not cursor.at_end:
        raise BagError("a chunk is longer than its fields")
    records = _unpack(packed, compression, size)
    if len(records) != size:
        raise BagError(f"a chunk must have {size} bytes, got {len(records)}")
    if checksum and zlib.crc32(records) != checksum:
        raise BagError("the checksum of a chunk does not fit its content")
    return records


def torn_chunk(content: bytes) -> bytes:
    """The records of a chunk whose end is missing: what is there, if it was not compressed."""
    try:
        cursor = Cursor(content)
        _, _, size, checksum = cursor.numbers("QQQI")
        compression = cursor.text()
        cursor.numbers("Q")
    except (struct.error, UnicodeError):
        return b""
    records = content[cursor.offset :][:size]
    whole = len(records) == size
    if compression or (whole and checksum and zlib.crc32(records) != checksum):
        return b""
    return records


def split_records(records: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of each whole record's content."""
    offset, end = 0, len(records)
    while offset + RECORD_HEAD.size <= end:
        opcode, length = RECORD_HEAD.unpack_from(records, offset)
        start = offset + RECORD_HEAD.size
        if length > end - start:
            return
        yield opcode, start, start + length
        offset = start + length


def split_messages(records: bytes) -> Iterator[tuple[int, int, int, int, int]]:
    """(channel, log time, publish time, start, end of the data) of each whole message."""
    offset, end = 0, len(records)
    head, head_size, unpack = MESSAGE_RECORD_HEAD, MESSAGE_RECORD_HEAD.size, RECORD_HEAD.unpack_from
    while offset + RECORD_HEAD.size <= end:
        opcode, length = unpack(records, offset)
        following = offset + RECORD_HEAD.size + length
        if following > end:
            return
        if opcode == MESSAGE and offset + head_size <= following:
            _, _, channel, _, log_time, publish_time = head.unpack_from(records, offset)
            yield channel, log_time, publish_time, offset + head_size, following
        offset = following


def _unpack(packed: bytes, compression: str, size: int) -> bytes:
    if size > _LARGEST_UNPACKED:
        raise BagError(f"a chunk must have {_LARGEST_UNPACKED} bytes at most, got {size}")
    try:
        if compression == "":
            return packed
        if compression == "zstd":
            if zstandard.frame_content_size(packed) > size:
                raise BagError(f"a chunk must unpack to {size} bytes, its packing says more")
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=max(size, 1))
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise BagError(f"a chunk cannot be unpacked ({error})") from None
    raise BagError(f"compression of a chunk must be zstd, lz4 or none, got {compression!r}")
