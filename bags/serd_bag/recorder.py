"""A recorder without ROS: writes, flushes, watches the disk, counts episodes; the last seconds.

A fault of the disk never raises: what was written is kept and closed, and `status` holds the
problem; the caller must stop the robot.
"""

import shutil
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

from serd_bag.errors import BagError, FileError
from serd_bag.formats.rosbag2.qos import RELIABLE, QosProfile
from serd_bag.messages.plain import diagnostic_array
from serd_bag.reader import AFTER_NS, BEFORE_NS, PAUSE
from serd_bag.writer import BagWriter, new_folder

_EPISODE = "episode"
_CHECK_PERIOD_S = 1.0
_LONGEST_FLUSH_S = 0.5
#: Bytes that Python needs for each message beside its data.
_OVERHEAD = 200


@dataclass(frozen=True)
class RecorderSettings:
    """How a bag is recorded; BagError where a value is out of its range.

    max_file_bytes: size at which the next file is started, None for one file; compression: of the
    chunks; flush_period_s: what a killed process may lose, at most 0.5 s; sync: wait for the disk
    at each flush; min_free_bytes: recording ends while this much of the disk is still free.
    """

    max_file_bytes: int | None = None
    compression: Literal["none", "zstd"] = "none"
    flush_period_s: float = 0.25
    sync: bool = True
    min_free_bytes: int = 100_000_000

    def __post_init__(self) -> None:
        if not 0 < self.flush_period_s <= _LONGEST_FLUSH_S:
            raise BagError(
                f"flush_period_s must be above 0 and at most {_LONGEST_FLUSH_S}, got"
                f" {self.flush_period_s}"
            )
        if self.max_file_bytes is not None and self.max_file_bytes <= 0:
            raise BagError(f"max_file_bytes must be above 0 or None, got {self.max_file_bytes}")
        if self.min_free_bytes < 0:
            raise BagError(f"min_free_bytes must be at least 0, got {self.min_free_bytes}")


@dataclass(frozen=True)
class RecorderStatus:
    """What a recorder has done.

    recording: whether it still records; problem: why recording ended by itself, else empty; counts:
    messages in the bag by topic; n_lost: messages since it ended, and of the last flush period
    before; episodes_ended, outcomes: by the marks on the topic `episode`.
    """

    recording: bool
    problem: str
    counts: dict[str, int]
    n_lost: int
    size_bytes: int
    free_bytes: int
    episodes_ended: int
    outcomes: dict[str, int]

    @property
    def n_messages(self) -> int:
        """Messages in the bag."""
        return sum(self.counts.values())


class BagRecorder:
    """Records into one bag until it is closed or a write fails.

        recorder = BagRecorder("drive")
        recorder.add_topic("/odom", "nav_msgs/msg/Odometry")
        recorder.record("/odom", data, time.time_ns())  # and poll() at least every 0.1 s
        status = recorder.close()

    directory: of the bag, new or empty; clock: time in s that never goes back; free_bytes: bytes
    that are free on the disk of a folder. BagError where the folder cannot be used. paused: set it
    to leave out what comes; the metadata record `PAUSE` marks the gap.
    """

    def __init__(
        self,
        directory: str | Path,
        *,
        settings: RecorderSettings | None = None,
        clock: Callable[[], float] = time.monotonic,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self.settings = settings or RecorderSettings()
        self._clock = clock
        self._free_bytes_of = free_bytes
        self._writer = BagWriter(
            directory,
            max_file_bytes=self.settings.max_file_bytes,
            compression=self.settings.compression,
            flush_period_s=self.settings.flush_period_s,
            sync=self.settings.sync,
            clock=clock,
        )
        self.directory = self._writer.directory
        self._recording = True
        self.paused = False
        #: Log times of the last message, and of the last one before a pause that is not marked yet.
        self._last_ns = self._paused_after_ns = 0
        self._problem = ""
        self._n_lost = 0
        self._outcome_of: dict[str, str] = {}
        self._free_bytes = 0
        self._check_disk()

    def add_topic(
        self, name: str, type_name: str, qos: tuple[QosProfile, ...] = (RELIABLE,)
    ) -> None:
        """Declare a topic before its first message."""
        self._writer.add_topic(name, type_name, qos)

    def record(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> bool:
        """Store one message, or leave it out while paused; returns False where it is lost because
        recording has ended.

        BagError for a topic that was not added or a time below 0.
        """
        if not self._recording:
            self._n_lost += 1
            return False
        if self.paused:
            self._paused_after_ns = self._paused_after_ns or self._last_ns
            return True
        try:
            if self._paused_after_ns:
                values = {AFTER_NS: str(self._paused_after_ns), BEFORE_NS: str(log_time_ns)}
                self._writer.add_metadata(PAUSE, values)
                self._paused_after_ns = 0
            self._writer.write(topic, data, log_time_ns, publish_time_ns)
        except FileError as error:
            if not self._writer.failed:
                raise
            self._end(str(error))
            return False
        self._last_ns = log_time_ns
        if topic.rsplit("/", 1)[-1] == _EPISODE:
            self._count_mark(data)
        return True

    def poll(self) -> None:
        """Flush what is due and check the free space; call it about every 0.1 s of wall time."""
        if not self._recording:
            return
        try:
            self._writer.flush_if_due()
        except FileError as error:
            self._end(str(error))
            return
        if self._clock() - self._checked_s >= _CHECK_PERIOD_S:
            self._check_disk()

    @property
    def status(self) -> RecorderStatus:
        """The present status."""
        return RecorderStatus(
            recording=self._recording,
            problem=self._problem,
            counts=dict(self._writer.counts),
            n_lost=self._n_lost,
            size_bytes=self._writer.size,
            free_bytes=self._free_bytes,
            episodes_ended=len(self._outcome_of),
            outcomes=dict(Counter(self._outcome_of.values())),
        )

    def close(self) -> RecorderStatus:
        """Finish the bag; further calls do nothing."""
        if self._recording:
            self._end()
        return self.status

    def _check_disk(self) -> None:
        self._checked_s = self._clock()
        try:
            self._free_bytes = self._free_bytes_of(self.directory)
        except OSError as error:
            self._end(f"cannot read the free space of {self.directory}: {error}")
            return
        if self._free_bytes < self.settings.min_free_bytes:
            self._end(
                f"disk of {self.directory} must have {self.settings.min_free_bytes} bytes free,"
                f" got {self._free_bytes}; recording ended, free some space"
            )

    def _end(self, problem: str = "") -> None:
        """Finish the bag; where writing fails it stays as it is and can be recovered."""
        self._recording = False
        self._problem = problem
        taken = self._writer.n_messages
        try:
            self._writer.close()
        except FileError as error:
            self._problem = problem or str(error)
        self._n_lost += taken - self._writer.n_messages

    def _count_mark(self, data: bytes) -> None:
        try:
            _, statuses = diagnostic_array(data)
        except BagError:
            return
        for status in statuses:
            if status.name == _EPISODE and status.message == "end":  # a later one replaces it
                number = status.values.get("episode", "")
                self._outcome_of[number] = status.values.get("outcome", "")


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
