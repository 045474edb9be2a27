"""What looks like records in an area of an MCAP file whose checksum does not fit.

A message counts where its channel is known, its time is within those of its chunk, and no other
record begins within it; without the head of its chunk, another record must follow it.
"""

from collections.abc import Callable, Iterator

from mcap.opcode import Opcode

from serd_bag.formats.limits import LARGEST_DEFINITION
from serd_bag.formats.mcap.data_section import IN_AREAS, RUN_PATTERN, Area
from serd_bag.formats.mcap.records import MESSAGE_HEAD, RECORD_HEAD

_MESSAGE = int(Opcode.MESSAGE)


class Remains:
    """The records of one area; is_known: whether a number is that of a channel."""

    def __init__(self, area: Area, is_known: Callable[[int], bool]) -> None:
        self._block, self._start, self._stop = area.block, area.start, area.end
        self._is_known = is_known
        self._first_ns, self._last_ns = 0, (1 << 64) - 1
        self._has_head = area.doubted is not None and area.doubted.first_ns <= area.doubted.last_ns
        if self._has_head and area.doubted is not None:
            self._first_ns, self._last_ns = area.doubted.first_ns, area.doubted.last_ns

    def places(self) -> Iterator[tuple[int, int]]:
        """Yield where in the block each of them begins and ends."""
        place: int | None = self._start
        while place is not None and place < self._stop:
            end = self._end_of(place)
            if end is not None and end < self._stop and self._end_of(end) is None:
                # It is longer than it states where another record begins within it.
                end = end if self._has_head and self._next(place + 1, end) is None else None
            if end is None:
                place = self._next(place + 1, self._stop)
                continue
            yield place, end
            place = end

    def _next(self, place: int, stop: int) -> int | None:
        while (found := RUN_PATTERN.search(self._block, place, stop)) is not None:
            if self._end_of(found.start()) is not None:
                return found.start()
            place = found.start() + 1
        return None

    def _end_of(self, place: int) -> int | None:
        """Where the record ends that seems to begin there."""
        if place + RECORD_HEAD.size > self._stop or self._block[place] not in IN_AREAS:
            return None
        opcode, length = RECORD_HEAD.unpack_from(self._block, place)
        end: int = place + RECORD_HEAD.size + length
        if end > self._stop or (opcode != _MESSAGE and length > LARGEST_DEFINITION):
            return None
        if opcode == _MESSAGE:
            if end < place + MESSAGE_HEAD.size:
                return None
            _, _, channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(self._block, place)
            if not (self._first_ns <= log_time <= self._last_ns and self._is_known(channel)):
                return None
        return end
