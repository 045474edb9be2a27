"""A rosbag2 directory (MCAP), written so that a crash costs at most the last flush period.

Directory `name` holds name_0.mcap, name_1.mcap, ... and, once closed, metadata.yaml.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from serd_bag.errors import BagError, FileError, disk_errors
from serd_bag.files import atomic_write_text
from serd_bag.formats.mcap.window import FileWindow
from serd_bag.formats.mcap.writer import Compression, McapWriter
from serd_bag.formats.rosbag2.layout import (
    FILE_NAME,
    ROOT_KEY,
    FileSpan,
    bag_metadata,
    metadata_text,
)
from serd_bag.formats.rosbag2.message_types import MessageType, message_type
from serd_bag.formats.rosbag2.qos import RELIABLE, QosProfile
from serd_bag.nearest import hint
from serd_bag.topic import Topic

_LAST_TIME_NS = 2**63 - 1


class BagWriter:
    """Writes serialized messages (CDR bytes) as a new bag.

        with BagWriter("drive") as writer:
            writer.add_topic("/odom", "nav_msgs/msg/Odometry")
            writer.write("/odom", data, log_time_ns=time.time_ns())

    directory: of the bag, new or empty. max_file_bytes: size at which the next file is started,
    None for one file. compression: of chunks. flush_period_s: what a killed process may lose; call
    `flush_if_due` that often. sync: wait for the disk at each flush, so that power loss costs no
    more either. BagError where the disk cannot be written; failed: whether that happened;
    everything before it is kept. counts: messages by topic.
    """

    def __init__(
        self,
        directory: str | Path,
        *,
        max_file_bytes: int | None = None,
        compression: Compression = "none",
        flush_period_s: float = 0.25,
        sync: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.directory = Path(directory).resolve()
        with disk_errors("write", self.directory, BagError):
            self.directory.mkdir(parents=True, exist_ok=True)
            require_new_folder(self.directory)
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self._max_file_bytes = max_file_bytes
        self._compression: Compression = compression
        self._flush_period_s = flush_period_s
        self._sync = sync
        self._clock = clock
        self._finished: list[FileSpan] = []
        self._finished_bytes = 0
        self._channels: dict[str, int] = {}
        self._closed = False
        self.failed = False
        self._file = self._next_file()
        self._flushed_s = clock()

    def add_topic(
        self, name: str, kind: str | MessageType, qos: tuple[QosProfile, ...] = (RELIABLE,)
    ) -> None:
        """Declare a topic; `kind`: an installed message type by its name, or any by definition.

        BagError for an unknown type, and for a topic that has another type already.
        """
        topic = Topic(name, message_type(kind) if isinstance(kind, str) else kind, qos)
        known = self.topics.setdefault(name, topic)
        if known.message_type != topic.message_type:
            raise BagError(
                f"topic {name} must keep its type {known.type_name}, got {topic.type_name}"
                "; record it under another name"
            )
        if known is topic:
            self.counts[name] = 0
            self._channels[name] = self._file.add_topic(topic)

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Append one message; the publish time defaults to the log time.

        BagError for a topic that was not added, and for times below 0 or above 2^63-1 ns.
        """
        channel = self._channels.get(topic)
        if channel is None:
            raise BagError(f"topic {topic!r} must be added first; {hint(topic, self.topics)}")
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        if not (0 <= log_time_ns <= _LAST_TIME_NS and 0 <= published <= _LAST_TIME_NS):
            raise BagError(f"times must be 0 to 2^63-1 ns, got {log_time_ns} and {published}")
        self.counts[topic] += 1
        try:
            self._file.write(channel, data, log_time_ns, published)
        except BagError:
            self.failed = True
            raise
        self.flush_if_due()

    def copy_records(self, source: Path, spans: Sequence[tuple[int, int]]) -> None:
        """Append attachments and metadata records of another file: (offset, length) of each."""
        with disk_errors("read", source, BagError), source.open("rb", buffering=0) as stream:
            window = FileWindow(stream)
            for offset, length in spans:
                self._file.copy_record(window, offset, length)

    @property
    def n_messages(self) -> int:
        """Messages written so far."""
        return sum(self.counts.values())

    @property
    def size(self) -> int:
        """Bytes of all files so far."""
        return self._finished_bytes + self._file.size

    def flush_if_due(self) -> None:
        """Flush where the flush period is over; call it also while no messages arrive."""
        if self._clock() - self._flushed_s >= self._flush_period_s:
            self.flush()

    def flush(self) -> None:
        """Write everything to the disk; start the next file where this one is large enough."""
        self._flushed_s = self._clock()
        try:
            self._file.flush()
            if self._max_file_bytes is not None and self._file.size >= self._max_file_bytes:
                self._finish_file()
                following = self._next_file()
                self._finished_bytes += self._file.size
                self._file = following
        except BagError:
            self.failed = True
            raise

    def close(self) -> None:
        """Finish the file and write metadata.yaml; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._file.is_open:
                self._finish_file()
            text = metadata_text({ROOT_KEY: self._metadata(self._finished)})
            atomic_write_text(self.directory / FILE_NAME, text)
        except FileError:
            self.failed = True
            self.abandon()
            raise

    def abandon(self) -> None:
        """Close without a summary, as after a crash: for a disk on which writes fail.

        Afterwards `counts` holds the messages that are on the disk.
        """
        self._closed = True
        unwritten = self._file.unwritten if self._file.is_open else {}
        for name, channel in self._channels.items():
            self.counts[name] -= unwritten.get(channel, 0)
        self._file.close()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next_file(self) -> McapWriter:
        path = self.directory / f"{self.directory.name}_{len(self._finished)}.mcap"
        file = McapWriter(path, compression=self._compression, sync=self._sync)
        self._channels = {name: file.add_topic(topic) for name, topic in self.topics.items()}
        return file

    def _finish_file(self) -> None:
        self._file.flush()
        files = [*self._finished, self._file.span]
        self._file.finish({"serialized_metadata": metadata_text(self._metadata(files))})
        self._finished = files

    def _metadata(self, files: list[FileSpan]) -> dict[str, object]:
        topics = [(topic, self.counts[topic.name]) for topic in self.topics.values()]
        return bag_metadata(files, topics)


def require_new_folder(directory: Path) -> None:
    """BagError where the folder of a new bag is not empty, or a file stands in its place."""
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise BagError(f"bag folder {directory} must be new or empty; choose another name")
