"""Chunks of MCAP files: their heads, also where a chain of records is broken, and their records."""

import math
import re
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from io import BytesIO
from tempfile import TemporaryFile
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard

from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_CONTENT, most_unpacked
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.formats.mcap.window import FileWindow

#: first and last log time, size and checksum of the records, length of the compression's name
_FIELDS = struct.Struct("<QQQII")
_LONGEST_NAME = 16
_SIZE = struct.Struct("<Q")
_KNOWN = ("zstd", "lz4")
#: Bytes that are decompressed at once: zstd makes 8 MiB of them at most, lz4 copies the rest.
_ZSTD_PIECE, _PIECE = 256, 1 << 20
#: A chunk may unpack to this many times its size, or to so many bytes, if it states fewer.
_MOST_PACKED, _LEAST_UNPACKED = 10, 1 << 20
#: More bytes than this after the fields of an empty chunk are its records, not an extension.
_LARGEST_EXTENSION = 1024
#: Bytes with which a chunk can begin: opcode, length, times, sizes, checksum, compression.
CHUNK_PATTERN = re.compile(
    rb"\x06.{5}\0{3}.{28}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd).{5}\0{3}", re.DOTALL
)

LONGEST_HEAD = RECORD_HEAD.size + _FIELDS.size + _LONGEST_NAME + _SIZE.size


class ChunkHead(NamedTuple):
    """size, checksum: of the records; data_start, data_size: of them, packed."""

    first_ns: int
    last_ns: int
    size: int
    checksum: int
    compression: str
    data_start: int
    data_size: int


def chunk_head(record: bytes | bytearray) -> ChunkHead:
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

    def may_use(self, size: int) -> bool:
        """Whether so many more bytes that may be no chunk are tried."""
        self._n_tried -= size
        return self._n_tried >= 0

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

    def remains(self, head: ChunkHead, offset: int) -> tuple[bytes, int, int]:
        """What is left of the records of a damaged chunk: bytes, and begin and end of them there.

        Compressed ones are unpacked until that fails.
        """
        size = min(head.data_size, LARGEST_CONTENT, self._limit - offset - head.data_start)
        if size <= 0 or not self.may_use(size):
            return b"", 0, 0
        block, at = self._window.locate(offset, head.data_start + size)
        first = at + head.data_start
        if head.compression not in _KNOWN:
            return block, first, min(len(block), first + size)
        unpacked = BytesIO()
        with suppress(BagError):
            for part in self._parts(head, offset, size, min(head.size, LARGEST_CONTENT)):
                unpacked.write(part)
        return unpacked.getvalue(), 0, unpacked.tell()

    def unpacked_file(self, head: ChunkHead, offset: int) -> BinaryIO:
        """A temporary file with the records of a compressed chunk that is too large for memory.

        Raises BagError if they do not fit their checksum or cannot be unpacked.
        """
        file, digest = TemporaryFile(), 0  # noqa: SIM115 (its caller closes it)
        for part in self._parts(head, offset, head.data_size):
            digest = zlib.crc32(part, digest)
            file.write(part)
        if head.checksum not in (0, digest):
            raise BagError("the checksum of a chunk does not fit its content")
        file.flush()
        return file

    def _records(self, head: ChunkHead, offset: int, *, is_certain: bool) -> tuple[bytes, int, int]:
        """Unpack data of the size in the head; returns bytes, begin and end of the records."""
        size = head.data_start + head.data_size
        if head.data_size > LARGEST_CONTENT:
            raise BagError(f"a chunk must have {LARGEST_CONTENT} bytes at most, got {size}")
        if not (is_certain or self.may_use(size)):
            raise BagError("a chunk is longer than its record")
        block, at = self._window.locate(offset, size)
        first = at + head.data_start
        data = memoryview(block)[first : first + head.data_size]
        if len(data) < head.data_size:
            raise BagError("a chunk is longer than its record")
        unpacked = self._decompressed(head, offset, data) if head.compression else None
        records = data if unpacked is None else unpacked
        if head.checksum not in (0, zlib.crc32(records)):
            raise BagError("the checksum of a chunk does not fit its content")
        if unpacked is None:
            return block, first, first + len(data)
        return unpacked, 0, len(unpacked)

    def _decompressed(self, head: ChunkHead, offset: int, data: memoryview) -> bytes:
        """Decompress the records, in pieces unless the frame or the head states their size."""
        if head.compression == "zstd":
            with suppress(zstandard.ZstdError, MemoryError):
                size = zstandard.frame_content_size(data)
                size = head.size if size < 0 else size
                if 0 < size <= LARGEST_CONTENT:
                    self._use(size)
                    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        most = max(head.size, _MOST_PACKED * len(data), _LEAST_UNPACKED)
        return b"".join(self._parts(head, offset, len(data), min(most, LARGEST_CONTENT), _PIECE))

    def _parts(
        self, head: ChunkHead, offset: int, size: int, most: float = math.inf, of_lz4: int = 0
    ) -> Iterator[bytes]:
        """Unpack so many bytes of the data of a chunk; BagError where no more can be unpacked, and
        after `most` bytes. of_lz4: bytes that are unpacked at once."""
        begin, end = offset + head.data_start, offset + head.data_start + size
        step = of_lz4 if of_lz4 and head.compression == "lz4" else _ZSTD_PIECE
        places = range(begin, end, step)
        pieces = (self._window.read(place, min(step, end - place)) for place in places)
        try:
            for part in _unpacked(head.compression, pieces):
                self._use(len(part))
                most -= len(part)
                if most < 0:
                    raise BagError("a chunk unpacks to more bytes than one of its size can hold")
                yield part
        except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
            raise BagError(f"a chunk cannot be unpacked ({error})") from None

    def _use(self, n_bytes: int) -> None:
        self._n_left -= n_bytes
        if self._n_left < 0:
            raise BagError("the file unpacks to more than one of its size can hold")


def _unpacked(compression: str, pieces: Iterator[bytes]) -> Iterator[bytes]:
    """The parts that are unpacked of pieces; BagError where these end early, or of another kind."""
    if compression == "zstd":
        decompressor: Any = zstandard.ZstdDecompressor().decompressobj()
        yield from map(decompressor.decompress, pieces)
    elif compression == "lz4":
        decompressor = lz4.frame.LZ4FrameDecompressor()
        yield from parts_unpacked(decompressor, pieces)
    else:
        raise BagError(f"compression of a chunk must be zstd, lz4 or none, got {compression!r}")
    if not decompressor.eof:
        raise BagError("a chunk cannot be unpacked (it ends early)")


def parts_unpacked(decompressor: Any, pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The parts, of 1 MiB at most, that a decompressor of lz4 or bz2 makes of pieces."""
    for piece in pieces:
        while not decompressor.eof:
            part = decompressor.decompress(piece, _PIECE)
            yield part
            piece = b""
            if decompressor.needs_input or not part:
                break
