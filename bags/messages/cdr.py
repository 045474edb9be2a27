"""Plain values out of CDR bytes (the common data representation DDS sends), field by field.

Bytes 0 and 1 name the encoding (0x0000 big endian, 0x0001 little endian), 2 and 3 are options; the
fields follow, each aligned to its own size counted from byte 4.
"""

import struct

from bags.errors import BagError

_HEAD_SIZE = 4
_LONGEST_SEQUENCE = 10_000_000


class CdrCursor:
    """Reads fields one after the other; BagError where the bytes end too early."""

    def __init__(self, data: bytes) -> None:
        if len(data) < _HEAD_SIZE or data[0] != 0 or data[1] > 1:
            raise BagError(
                f"message must begin with a CDR head (00 00 or 00 01), got {data[:4].hex(' ')!r}"
            )
        self._data = data
        self._order = "<" if data[1] else ">"
        self._offset = _HEAD_SIZE

    def number(self, code: str) -> float:
        """One number by its code in the struct module."""
        return self.numbers(code, 1)[0]

    def numbers(self, code: str, count: int) -> tuple[float, ...]:
        """`count` numbers of the same kind."""
        size = struct.calcsize("<" + code)
        start = _aligned(self._offset, size)
        end = start + size * count
        if end > len(self._data):
            raise BagError(f"message must have {end} bytes at least, got {len(self._data)}")
        self._offset = end
        return struct.unpack_from(f"{self._order}{count}{code}", self._data, start)

    def length(self) -> int:
        """Number of elements of the sequence that follows."""
        count = int(self.number("I"))
        if count > min(_LONGEST_SEQUENCE, len(self._data)):
            raise BagError(f"sequence must fit its message of {len(self._data)} bytes, got {count}")
        return count

    def text(self) -> str:
        """A string (UTF-8, its length counts the final zero)."""
        return self.raw(self.length())[:-1].decode("utf-8", errors="replace")

    def raw(self, size: int) -> bytes:
        """The next `size` bytes."""
        if self._offset + size > len(self._data):
            raise BagError(f"message must hold {size} more bytes, got {len(self._data)} in all")
        start, self._offset = self._offset, self._offset + size
        return self._data[start : self._offset]


def _aligned(offset: int, size: int) -> int:
    return offset + -(offset - _HEAD_SIZE) % size
