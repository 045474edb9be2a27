"""The index behind a chunk, which players trust, compared with the messages in the chunk."""

from array import array

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from bags.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD

#: channel, size of the entries in bytes; log time, offset
INDEX_HEAD_SIZE = 6
ENTRY_SIZE = 16
_MESSAGE = int(Opcode.MESSAGE)

#: (number of messages, 3): channel, log time, offset in the chunk
_Positions = NDArray[np.uint64]


def entries_end(content: bytes) -> int:
    """Where the entries of a message index end, by the size it declares."""
    return INDEX_HEAD_SIZE + int.from_bytes(content[2:INDEX_HEAD_SIZE], "little")


class MessageIndexes:
    """The index records behind one chunk."""

    def __init__(self) -> None:
        self._expected: _Positions | None = None
        self._found: list[_Positions] = []
        self._n_found = 0

    def begin(self, block: bytes, start: int, end: int, most: int) -> None:
        """Expect an index of the chunk whose records are there; most: records to read."""
        self._expected = _positions(block, start, end, most)

    def add(self, content: bytes) -> None:
        """Take one message index of the chunk; more entries than it has messages are not kept."""
        n_entries = max(0, entries_end(content) - INDEX_HEAD_SIZE) // ENTRY_SIZE
        self._n_found += n_entries
        if self._expected is None or self._n_found > len(self._expected):
            return
        entries = np.frombuffer(content, "<u8", 2 * n_entries, INDEX_HEAD_SIZE).reshape(-1, 2)
        channel = int.from_bytes(content[:2], "little")
        self._found.append(np.column_stack([np.full(n_entries, channel, np.uint64), entries]))

    def fit(self) -> bool:
        """Whether each message is listed where it is; the next chunk may then be added.

        A chunk without any index is as good: the format leaves them to the writer.
        """
        expected, found, n_found = self._expected, self._found, self._n_found
        self._expected, self._found, self._n_found = None, [], 0
        if expected is None or not n_found:
            return True
        return n_found == len(expected) and np.array_equal(
            _sorted(np.concatenate(found)), _sorted(expected)
        )


def _sorted(positions: _Positions) -> _Positions:
    return positions[np.lexsort(positions.T)]


def _positions(block: bytes, start: int, end: int, most: int) -> _Positions:
    """(channel, log time, offset) of each message."""
    found = array("Q")
    offset = start
    for _ in range(most):
        if offset + RECORD_HEAD.size > end:
            break
        opcode, length = RECORD_HEAD.unpack_from(block, offset)
        following = offset + RECORD_HEAD.size + length
        if opcode == _MESSAGE and offset + MESSAGE_HEAD.size <= following <= end:
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(block, offset)
            found.extend((channel, log_time, offset - start))
        offset = following
    return np.frombuffer(found, np.uint64).reshape(-1, 3)
