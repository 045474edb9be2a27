"""Records of the MCAP container (version 0): opcode u8, length u64, content; little endian.

https://mcap.dev/spec. Strings and maps carry their length as u32.
"""

import struct
from collections.abc import Mapping

MAGIC = b"\x89MCAP0\r\n"

HEADER = 0x01
FOOTER = 0x02
SCHEMA = 0x03
CHANNEL = 0x04
MESSAGE = 0x05
CHUNK = 0x06
MESSAGE_INDEX = 0x07
CHUNK_INDEX = 0x08
STATISTICS = 0x0B
METADATA = 0x0C
METADATA_INDEX = 0x0D
SUMMARY_OFFSET = 0x0E
DATA_END = 0x0F
FIRST_PRIVATE = 0x80

RECORD_HEAD = struct.Struct("<BQ")
#: channel, sequence, log time, publish time
MESSAGE_HEAD = struct.Struct("<HIQQ")
#: opcode, length, then the head of a message
MESSAGE_RECORD_HEAD = struct.Struct("<BQHIQQ")
#: start time, end time, uncompressed size, uncompressed CRC
CHUNK_HEAD = struct.Struct("<QQQI")
FOOTER_CONTENT = struct.Struct("<QQI")
#: messages, schemas, channels, attachments, metadata, chunks, start time, end time
STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")
FOOTER_SIZE = RECORD_HEAD.size + FOOTER_CONTENT.size


def record(opcode: int, content: bytes) -> bytes:
    """A whole record."""
    return RECORD_HEAD.pack(opcode, len(content)) + content


def text(value: str | bytes) -> bytes:
    """A string or byte string with its length."""
    content = value.encode("utf-8") if isinstance(value, str) else value
    return struct.pack("<I", len(content)) + content


def text_map(values: Mapping[str, str]) -> bytes:
    """A map of strings with its length in bytes."""
    return text(b"".join(text(key) + text(value) for key, value in values.items()))


class Cursor:
    """Reads fields one after the other; struct.error or UnicodeError where they do not fit."""

    def __init__(self, content: bytes | memoryview) -> None:
        self._content = memoryview(content)
        self.offset = 0

    def numbers(self, layout: str) -> tuple[int, ...]:
        """Numbers in the layout of the struct module, little endian."""
        values = struct.unpack_from("<" + layout, self._content, self.offset)
        self.offset += struct.calcsize("<" + layout)
        return values

    def raw(self, wide: bool = False) -> bytes:
        """A byte string with its length before it (u32, or u64 where wide)."""
        (size,) = self.numbers("Q" if wide else "I")
        if size > len(self._content) - self.offset:
            raise struct.error(f"a field of {size} bytes goes beyond its record")
        start, self.offset = self.offset, self.offset + size
        return bytes(self._content[start : self.offset])

    def text(self) -> str:
        """A string."""
        return self.raw().decode("utf-8")

    def text_map(self) -> dict[str, str]:
        """A map of strings."""
        inner = Cursor(self.raw())
        values = {}
        while not inner.at_end:
            key = inner.text()
            values[key] = inner.text()
        return values

    @property
    def at_end(self) -> bool:
        """Whether all was read."""
        return self.offset == len(self._content)
