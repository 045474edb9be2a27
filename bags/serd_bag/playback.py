"""Replay of a bag at any rate, with pauses: which messages are due at a wall time.

Bag time runs `rate` times as fast as the wall time that is passed in. Messages are returned in the
order of the bag, each at its log time; a log time that steps back is due at once.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from serd_bag.errors import BagError
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage


@dataclass(frozen=True)
class Excerpt:
    """The part of a bag that is played.

    start_s, duration_s: bag time after the first message, by log times; topics: full names.
    """

    topics: frozenset[str]
    start_s: float = 0.0
    duration_s: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start_s) and self.start_s >= 0):
            raise BagError(f"start must be finite and at least 0 s, got {self.start_s}")
        if not self.duration_s > 0:
            raise BagError(f"duration must be above 0 s, got {self.duration_s}")

    def messages(self, reader: BagReader) -> Iterator[RawMessage]:
        """Messages in the order of the bag; BagError where the bag is damaged."""
        first_ns: int | None = None
        for message in reader.messages(self.topics):
            if first_ns is None:
                first_ns = message.log_time_ns
            passed_s = (message.log_time_ns - first_ns) / 1e9
            if self.start_s <= passed_s < self.start_s + self.duration_s:
                yield message


class Playback:
    """One replay. wall_s: any clock that never goes back; the replay starts at the first `due`."""

    def __init__(self, messages: Iterable[RawMessage], *, rate: float = 1.0) -> None:
        self._rest: Iterator[RawMessage] = iter(messages)
        self._next = next(self._rest, None)
        self._rate = _checked(rate)
        self._bag_ns = self._next.log_time_ns if self._next else 0
        self._wall_s: float | None = None
        self.paused = False

    @property
    def finished(self) -> bool:
        """Whether all messages were returned."""
        return self._next is None

    def bag_time_ns(self, wall_s: float) -> int:
        """Bag time at a wall time, for /clock; it never goes back."""
        if self._wall_s is not None and not self.paused:
            passed_ns = round((wall_s - self._wall_s) * self._rate * 1e9)
            self._bag_ns += max(0, passed_ns)
        self._wall_s = wall_s
        return self._bag_ns

    def due(self, wall_s: float, *, at_most: int | None = None) -> list[RawMessage]:
        """The messages that are due; those above `at_most` are left for the next call."""
        now_ns = self.bag_time_ns(wall_s)
        found: list[RawMessage] = []
        while self._next is not None and self._next.log_time_ns <= now_ns:
            if self.paused or (at_most is not None and len(found) >= at_most):
                break
            found.append(self._next)
            self._next = next(self._rest, None)
        return found

    def wait_s(self, wall_s: float) -> float:
        """Wall time until the next message is due: 0 for now, infinite when paused or finished."""
        if self._next is None or self.paused:
            return math.inf
        return max(0.0, (self._next.log_time_ns - self.bag_time_ns(wall_s)) / 1e9 / self._rate)

    def pause(self, wall_s: float) -> None:
        """Stop bag time."""
        self.bag_time_ns(wall_s)
        self.paused = True

    def resume(self, wall_s: float) -> None:
        """Continue bag time where it stopped."""
        self.bag_time_ns(wall_s)
        self.paused = False

    def step(self) -> RawMessage | None:
        """The next message at once, with bag time set to it; None after the last."""
        message = self._next
        if message is not None:
            self._bag_ns = max(self._bag_ns, message.log_time_ns)
            self._next = next(self._rest, None)
        return message

    def set_rate(self, wall_s: float, rate: float) -> None:
        """Change the rate from now on."""
        self.bag_time_ns(wall_s)
        self._rate = _checked(rate)


class UntilDamage(Iterator[RawMessage]):
    """The readable messages of a bag: ends at the first BagError, whose text is `damage` then.

    An error in the middle of a replay would lose the messages that were read just before it.
    """

    def __init__(self, messages: Iterable[RawMessage]) -> None:
        self._messages = iter(messages)
        self.damage = ""

    def __next__(self) -> RawMessage:
        """The next message."""
        try:
            return next(self._messages)
        except BagError as error:
            self.damage = str(error)
            raise StopIteration from None


def _checked(rate: float) -> float:
    if not (math.isfinite(rate) and rate > 0):
        raise BagError(f"rate must be finite and above 0, got {rate}; pause instead of rate 0")
    return rate
