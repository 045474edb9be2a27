"""Records of MCAP files, sound or damaged: those of the `mcap` package, with every size checked.

The readers of that package take what a stream gives; here a record that ends early is a BagError.
Bytes after the fields of a record are ignored, as the format demands: later versions may add some.
Attachments and metadata records may be large, and are read in parts.
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
_TIMES = struct.Struct("<QQ")
_SHORT_SIZE, _LONG_SIZE, _CHECKSUM = struct.Struct("<I"), struct.Struct("<Q"), struct.Struct("<I")


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


def index_of_record(window: FileWindow, offset: int, length: int) -> CopiedIndex:
    """The index of the attachment or metadata record there, with all its bytes; or BagError."""
    if window.read(offset, 1) == bytes([Opcode.ATTACHMENT]):
        return attachment_index(window, offset, length)[0]
    name, _ = _text(window, offset + RECORD_HEAD.size, offset + length)
    return MetadataIndex(offset, length, name)


def attachment_index(window: FileWindow, offset: int, length: int) -> tuple[AttachmentIndex, int]:
    """(index, place of the checksum) of the attachment record there; or BagError."""
    end = offset + length
    place = offset + RECORD_HEAD.size
    log_time, create_time = _unpacked(window, _TIMES, place, end)
    name, place = _text(window, place + _TIMES.size, end)
    media_type, place = _text(window, place, end)
    (data_size,) = _unpacked(window, _LONG_SIZE, place, end)
    place += _LONG_SIZE.size + data_size
    _unpacked(window, _CHECKSUM, place, end)
    index = AttachmentIndex(offset, length, log_time, create_time, data_size, name, media_type)
    return index, place


def check_record(window: FileWindow, offset: int, length: int) -> None:
    """BagError where the record is cut off, or its checksum, if it has one, does not fit."""
    if not isinstance(index_of_record(window, offset, length), AttachmentIndex):
        return
    _, place = attachment_index(window, offset, length)
    (checksum,) = _CHECKSUM.unpack(window.read(place, _CHECKSUM.size))
    if checksum and window.checksum(offset + RECORD_HEAD.size, place) != checksum:
        raise BagError("the checksum of an attachment does not fit its content")


def _text(window: FileWindow, place: int, end: int) -> tuple[str, int]:
    """(text, where it ends)."""
    (size,) = _unpacked(window, _SHORT_SIZE, place, end)
    place += _SHORT_SIZE.size
    if size > min(end - place, LARGEST_DEFINITION):
        raise BagError("an attachment or metadata record is longer than its record")
    return window.read(place, size).decode("utf-8", errors="replace"), place + size


def _unpacked(window: FileWindow, fields: struct.Struct, place: int, end: int) -> tuple[int, ...]:
    if place + fields.size > end:
        raise BagError("an attachment or metadata record ends early")
    return fields.unpack(window.read(place, fields.size))
