"""When a raw message that begins with a header was made."""

from typing import Literal

from bags.errors import BagError

_CDR_HEADER = 4
_NS = 1_000_000_000


def message_stamp_ns(data: bytes) -> int:
    """The stamp (ns) a message begins with: sec (int32), nanosec (uint32) after the CDR header."""
    if len(data) < _CDR_HEADER + 8:
        raise BagError(
            f"message must begin with a stamp (12 bytes), got {len(data)} bytes; drop it"
        )
    order: Literal["little", "big"] = "little" if data[1] & 1 else "big"
    seconds = int.from_bytes(data[_CDR_HEADER : _CDR_HEADER + 4], order, signed=True)
    nanoseconds = int.from_bytes(data[_CDR_HEADER + 4 : _CDR_HEADER + 8], order)
    return seconds * _NS + nanoseconds
