"""Attachments and metadata records: their entries in the index, and their checksums."""

import struct

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, MetadataIndex

from bags.errors import BagError
from bags.formats.limits import LARGEST_DEFINITION
from bags.formats.mcap.records import RECORD_HEAD
from bags.formats.mcap.window import FileWindow

_TIMES = struct.Struct("<QQ")
_SHORT_SIZE, _LONG_SIZE, _CHECKSUM = struct.Struct("<I"), struct.Struct("<Q"), struct.Struct("<I")


def index_of_record(
    window: FileWindow, offset: int, length: int
) -> AttachmentIndex | MetadataIndex:
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
