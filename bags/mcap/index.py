"""The index behind an MCAP chunk, held against the messages in the chunk.

Players that jump to a time trust it; a message it leaves out or misplaces is lost to them.
"""

import struct
from collections import defaultdict
from collections.abc import Sequence

from bags.mcap.chunk import split_messages
from bags.mcap.format import MESSAGE_RECORD_HEAD

_ENTRY = struct.Struct("<QQ")
#: channel, size of the entries in bytes
_HEAD = struct.Struct("<HI")


def index_fits(records: bytes, indexes: Sequence[bytes]) -> bool:
    """Whether the contents of a chunk's message index records tell of each message where it is.

    A chunk without any is as good: the format leaves them to the writer.
    """
    return not indexes or _told(indexes) == _held(records)


def _told(indexes: Sequence[bytes]) -> dict[int, list[tuple[int, int]]] | None:
    """(log time, place) by channel; None where a record is damaged."""
    told: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for content in indexes:
        if len(content) < _HEAD.size:
            return None
        channel, size = _HEAD.unpack_from(content)
        entries = content[_HEAD.size :]
        if len(entries) != size or size % _ENTRY.size:
            return None
        if entries:
            told[channel].extend(_ENTRY.iter_unpack(entries))
    return {channel: sorted(entries) for channel, entries in told.items()}


def _held(records: bytes) -> dict[int, list[tuple[int, int]]]:
    held: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for channel, log_time, _, start, _ in split_messages(records):
        held[channel].append((log_time, start - MESSAGE_RECORD_HEAD.size))
    return {channel: sorted(entries) for channel, entries in held.items()}
