"""Records of MCAP files, sound or damaged: those of the `mcap` package, with every size checked.

The readers of that package take what a stream gives; here a record that ends early is a BagError.
Bytes after the fields of a record are ignored, as the format demands: later versions may add some.
Attachments may be large, and are read in parts.
"""

import struct
from io import BytesIO
from typing import TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, McapRecord, MetadataIndex

from serd_bag.errors import BagError
from serd_bag.formats.limits import LARGEST_DEFINITION
from serd_bag.formats.mcap.window import FileWindow

#: opcode, length of the content
RECORD_HEAD = struct.Struct("<BQ")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD = struct.Struct("<BQHIQQ")

AnyRecord = TypeVar("AnyRecord", bound=McapRecord)
#: The index of a record that is copied into a new bag as it is.
CopiedIndex = AttachmentIndex | MetadataIndex
_CHECKSUM_SIZE = 4


class _StrictStream(ReadDataStream):
    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data

    def text(self) -> str:
        """A text behind its length; bytes that are none are replaced."""
        return self.read(self.read4()).decode("utf-8", errors="replace")


def read_record(kind: type[AnyRecord], content: bytes) -> AnyRecord:
    """The record with this content; BagError where a field is missing or is no text."""
    name = kind.__name__.lower()
    if len(content) > LARGEST_DEFINITION:
        raise BagError(f"a {name} record has {len(content)} bytes, more than {LARGEST_DEFINITION}")
    try:
        record: AnyRecord = kind.read(_StrictStream(BytesIO(content)))  # type: ignore[attr-defined]
    except (McapError, struct.error, UnicodeError, OverflowError) as error:
        reason = str(error) or "it ends early"
        raise BagError(f"a {name} record is damaged ({reason})") from None
    return record


def copied_index(
    window: FileWindow, offset: int, length: int, *, verify: bool = False
) -> CopiedIndex:
    """The index of the attachment or metadata record there, with all its bytes.

    verify: compare the checksum of an attachment, if it has one, with its content. Raises BagError
    if that does not fit, and if the record is cut off.
    """
    begin, end = offset + RECORD_HEAD.size, offset + length
    content = window.read(begin, min(length - RECORD_HEAD.size, LARGEST_DEFINITION))
    stream = _StrictStream(BytesIO(content))
    try:
        if window.read(offset, 1) != bytes([Opcode.ATTACHMENT]):
            return MetadataIndex(offset, length, stream.text())
        log_time, create_time = stream.read8(), stream.read8()
        name, media_type, data_size = stream.text(), stream.text(), stream.read8()
        place = begin + stream.count + data_size
        if place + _CHECKSUM_SIZE > end:
            raise EndOfFile
    except EndOfFile:
        raise BagError("an attachment or metadata record ends early") from None
    checksum = int.from_bytes(window.read(place, _CHECKSUM_SIZE), "little") if verify else 0
    if checksum and window.checksum(begin, place) != checksum:
        raise BagError("the checksum of an attachment does not fit its content")
    return AttachmentIndex(offset, length, log_time, create_time, data_size, name, media_type)
