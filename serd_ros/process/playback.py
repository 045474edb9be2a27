"""Replay of a bag at any rate: which messages are due at a wall time.

Bag time runs `rate` times as fast as the wall time that is passed in. Messages are returned in the
order of the bag, each at its log time; a log time that steps back is due at once.
"""

import math
from collections.abc import Iterable, Iterator

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage


def excerpt(
    reader: BagReader, topics: frozenset[str], start_s: float = 0.0, duration_s: float = math.inf
) -> Iterator[RawMessage]:
    """Messages of a part of a bag in its order; BagError where the bag is damaged.

    topics: full names; start_s, duration_s: bag time after the first message, by log times.
    """
    first_ns: int | None = None
    for message in reader.messages(topics):
        if first_ns is None:
            first_ns = message.log_time_ns
        passed_s = (message.log_time_ns - first_ns) / 1e9
        if start_s <= passed_s < start_s + duration_s:
            yield message


class Playback:
    """One replay: which messages are due at a time of a wall clock.

        playback = Playback(excerpt(reader, topics), rate=2.0)
        while not playback.finished:
            publish(playback.due(time.monotonic()))

    The replay starts at the first `due`. rate: seconds of bag time in a second of wall time, above
    0. It ends at the first BagError of the messages, whose text is `damage` then; the messages
    before are played.
    """

    def __init__(self, messages: Iterable[RawMessage], *, rate: float = 1.0) -> None:
        self.damage = ""
        self._rest: Iterator[RawMessage] = iter(messages)
        self._next = self._following()
        self._rate = rate
        self._bag_ns = self._next.log_time_ns if self._next else 0
        self._wall_s: float | None = None

    @property
    def finished(self) -> bool:
        """Whether all messages were returned."""
        return self._next is None

    def bag_time_ns(self, wall_s: float) -> int:
        """Bag time (ns) at a wall time (s) of any clock, for /clock; it never goes back."""
        if self._wall_s is not None:
            passed_ns = round((wall_s - self._wall_s) * self._rate * 1e9)
            self._bag_ns += max(0, passed_ns)
        self._wall_s = wall_s
        return self._bag_ns

    def due(self, wall_s: float, *, at_most: int | None = None) -> list[RawMessage]:
        """The messages that are due; those above `at_most` are left for the next call."""
        now_ns = self.bag_time_ns(wall_s)
        found: list[RawMessage] = []
        while self._next is not None and self._next.log_time_ns <= now_ns:
            if at_most is not None and len(found) >= at_most:
                break
            found.append(self._next)
            self._next = self._following()
        return found

    def _following(self) -> RawMessage | None:
        try:
            return next(self._rest, None)
        except BagError as error:
            self.damage = str(error)
            return None
