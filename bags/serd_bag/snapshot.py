"""The last seconds of the topics of a recorder, in memory, written as a bag on request."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from serd_bag.formats.rosbag2.qos import QosProfile
from serd_bag.writer import BagWriter, new_folder

#: Bytes that Python needs for each message beside its data.
_OVERHEAD = 200


class _Kept(NamedTuple):
    taken_s: float
    topic: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


class LastSeconds:
    """Keeps messages for some seconds, in at most so many bytes; the oldest leave first.

        last = LastSeconds(30.0, 100_000_000)
        last.take("/odom", data, time.time_ns(), sent_ns)
        last.save("fall", [("/odom", "nav_msgs/msg/Odometry", (RELIABLE,))])

    clock: time in s that never goes back.
    """

    def __init__(
        self, seconds: float, most_bytes: int, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._seconds, self._most_bytes, self._clock = seconds, most_bytes, clock
        self._recent, self._lasting = deque[_Kept](), deque[_Kept]()
        self._n_bytes = 0

    def take(self, topic: str, data: bytes, *times_ns: int, lasting: bool = False) -> None:
        """One message with its log and publish time; lasting: only bytes limit those, as a map."""
        kept = _Kept(self._clock(), topic, data, *times_ns)
        (self._lasting if lasting else self._recent).append(kept)
        self._n_bytes += len(data) + _OVERHEAD
        self._forget()
        while self._n_bytes > self._most_bytes:
            self._drop(self._recent or self._lasting)

    def save(
        self, directory: str | Path, topics: Iterable[tuple[str, str, tuple[QosProfile, ...]]]
    ) -> int:
        """Write them as a new bag, each as it came; returns how many.

        topics: name, type and quality of service of all that were taken. Lasting messages from
        before the others get the log time of the first of these. BagError where the disk cannot be
        written; then there is no bag.
        """
        self._forget()
        first_ns = self._recent[0].log_time_ns if self._recent else 0
        with new_folder(Path(directory)) as folder, BagWriter(folder) as writer:
            for topic in topics:
                writer.add_topic(*topic)
            for each in sorted([*self._lasting, *self._recent], key=lambda kept: kept.taken_s):
                log_time_ns = max(each.log_time_ns, first_ns)
                writer.write(each.topic, each.data, log_time_ns, each.publish_time_ns)
            return writer.n_messages

    def _forget(self) -> None:
        while self._recent and self._recent[0].taken_s < self._clock() - self._seconds:
            self._drop(self._recent)

    def _drop(self, kept: deque[_Kept]) -> None:
        self._n_bytes -= len(kept.popleft().data) + _OVERHEAD
