"""Bytes of a file at any place, through one block that is read ahead."""

import os
import re
import zlib
from typing import BinaryIO

_BLOCK = 256 << 10
_AHEAD = 32 << 10


class FileWindow:
    """Gives bytes of an open file, or of its part from `begin` to `end`, by their places there.

    size: bytes of the part. A block from `locate` stays as it is, a later call may return another.
    """

    def __init__(self, stream: BinaryIO, begin: int = 0, end: int | None = None) -> None:
        of_file = os.fstat(stream.fileno()).st_size
        self.size = max(0, min(of_file, of_file if end is None else end) - begin)
        self._begin = begin
        self._stream = stream
        self._start = 0
        self._block = b""

    def locate(self, offset: int, length: int) -> tuple[bytes, int]:
        """(block, where in it the bytes from `offset` are); shorter at the end of the file."""
        first = offset - self._start
        if first < 0 or first + length > len(self._block):
            self._block = b""
            self._block = self._read(offset, max(_BLOCK, length + _AHEAD))
            self._start, first = offset, 0
        return self._block, first

    def release(self) -> None:
        """Free the block."""
        self._block = b""

    def read(self, offset: int, length: int) -> bytes:
        """A copy of these bytes, fewer at the end of the file, without reading ahead for it."""
        first = offset - self._start
        if 0 <= first <= len(self._block) - length:
            return self._block[first : first + length]
        return self._read(offset, length)

    def _read(self, offset: int, length: int) -> bytes:
        self._stream.seek(self._begin + offset)
        return self._stream.read(max(0, min(length, self.size - offset)))

    def checksum(self, start: int, end: int) -> int:
        """CRC-32 of the bytes from `start` to `end`."""
        digest = 0
        for offset in range(start, end, _BLOCK):
            digest = zlib.crc32(self.read(offset, min(_BLOCK, end - offset)), digest)
        return digest

    def search(self, pattern: re.Pattern[bytes], start: int, longest: int) -> int | None:
        """First match from `start` on; longest: bytes of a match."""
        while start < self.size:
            block, first = self.locate(start, min(longest, self.size - start))
            found = pattern.search(block, first)
            if found:
                return start + found.start() - first
            start += max(1, len(block) - first - longest + 1)
        return None
