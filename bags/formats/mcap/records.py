"""Records of MCAP files, sound or damaged: those of the `mcap` package, with every size checked.

The readers of that package take what a stream gives; here a record that ends early is a BagError.
Bytes after the fields of a record are ignored, as the format demands: later versions may add some.
"""

import struct
from io import BytesIO
from typing import TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.records import McapRecord

from bags.errors import BagError
from bags.formats.limits import LARGEST_DEFINITION

#: opcode, length of the content
RECORD_HEAD = struct.Struct("<BQ")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD = struct.Struct("<BQHIQQ")

AnyRecord = TypeVar("AnyRecord", bound=McapRecord)


class _StrictStream(ReadDataStream):
    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data


def read_record(kind: type[AnyRecord], content: bytes) -> AnyRecord:
    """The record with this content; BagError where a field is missing or is no text."""
    name = kind.__name__.lower()
    if len(content) > LARGEST_DEFINITION:
        raise BagError(f"a {name} record has {len(content)} bytes, more than {LARGEST_DEFINITION}")
    try:
        record: AnyRecord = kind.read(_StrictStream(BytesIO(content)))  # type: ignore[attr-defined]
    except (McapError, struct.error, UnicodeError, OverflowError) as error:
        raise BagError(f"a {name} record is damaged ({error or 'it ends early'})") from None
    return record
