"""The part of a bag that is played: some topics, from some second on, for some seconds."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from bags.errors import BagError
from bags.reader import BagReader, RawMessage, topic_named


@dataclass(frozen=True)
class Excerpt:
    """start_s, duration_s: bag time after the first message, by log times; topics: full names."""

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


def named_topics(available: Collection[str], wanted: Collection[str]) -> frozenset[str]:
    """Full names of the wanted topics, all that are there for none wanted."""
    return frozenset(topic_named(available, name) for name in wanted) or frozenset(available)
