"""A rosbag2 directory (MCAP), written so that a crash costs at most the last flush period.

Directory `name` holds name_0.mcap, name_1.mcap, ... and, once closed, metadata.yaml.
"""

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from serd_bag.damage import FileScan
from serd_bag.errors import BagError, FileError, disk_errors
from serd_bag.files import atomic_write_text
from serd_bag.formats.limits import flow_yaml_text, yaml_text
from serd_bag.formats.mcap.writer import Compression, McapWriter
from serd_bag.formats.rosbag2.layout import (
    FILE_NAME,
    ROOT_KEY,
    FileSpan,
    bag_metadata,
)
from serd_bag.formats.rosbag2.qos import RELIABLE, QosProfile
from serd_bag.nearest import hint
from serd_bag.topic import Channel, MessageType, Record, Topic

_LAST_TIME_NS = 2**63 - 1
#: Name of the MCAP metadata record that holds what is in metadata.yaml.
ROS2_RECORD = "rosbag2"


class BagWriter:
    """Writes serialized messages (CDR bytes) as a new bag.

        with BagWriter("drive") as writer:
            writer.add_topic("/odom", "nav_msgs/msg/Odometry")
            writer.write("/odom", data, log_time_ns=time.time_ns())

    directory: of the bag, new or empty. max_file_bytes: size at which the next file is started,
    None for one file. compression: of chunks. flush_period_s: what a killed process may lose; call
    `flush_if_due` that often. sync: wait for the disk at each flush, so that power loss costs no
    more either. profile: of the files, ros1 for messages of ROS 1. BagError where the disk cannot
    be written; failed: whether that happened; everything before it is kept. counts: messages by
    topic. kept: values of another metadata.yaml, of which custom_data and ros_distro are taken.
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
        profile: str = "ros2",
    ) -> None:
        self.directory = Path(directory).resolve()
        with disk_errors("write", self.directory, BagError):
            self.directory.mkdir(parents=True, exist_ok=True)
            require_new_folder(self.directory)
        self.topics: dict[str, Topic] = {}
        self.counts: dict[str, int] = {}
        self.kept: Mapping[str, Any] = {}
        self._profile = profile
        self._max_file_bytes = max_file_bytes
        self._compression: Compression = compression
        self._flush_period_s = flush_period_s
        self._sync = sync
        self._clock = clock
        self._finished: list[FileSpan] = []
        self._finished_bytes = 0
        #: number of each channel in the present file, and its messages; the channel of each topic
        self._channels: dict[Channel, int] = {}
        self._counts: Counter[Channel] = Counter()
        self._channel_of: dict[str, Channel] = {}
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
        if isinstance(kind, str):
            from serd_bag.formats.rosbag2.message_types import message_type

            kind = message_type(kind)
        topic = Topic(name, kind, qos)
        known = self.topics.setdefault(name, topic)
        if known.message_type != topic.message_type:
            raise BagError(
                f"topic {name} must keep its type {known.type_name}, got {topic.type_name}"
                "; record it under another name"
            )
        if known is topic:
            self._channel_of[name] = topic.channel
            self.add_channel(topic.channel)

    def add_channel(self, channel: Channel) -> None:
        """Declare a channel of another file, for `write_record`; further calls do nothing."""
        if channel not in self._channels:
            self.counts.setdefault(channel.topic, 0)
            self._channels[channel] = self._file.add_channel(channel)

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int | None = None
    ) -> None:
        """Append one message; the publish time defaults to the log time.

        BagError for a topic that was not added, and for times below 0 or above 2^63-1 ns.
        """
        channel = self._channel_of.get(topic)
        if channel is None:
            raise BagError(f"topic {topic!r} must be added first; {hint(topic, self.topics)}")
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        if not (0 <= log_time_ns <= _LAST_TIME_NS and 0 <= published <= _LAST_TIME_NS):
            raise BagError(f"times must be 0 to 2^63-1 ns, got {log_time_ns} and {published}")
        self.write_record(Record(channel, 0, data, log_time_ns, published))

    def write_record(self, record: Record) -> None:
        """Append a message of another file as it is; its channel is declared with the first."""
        channel, sequence, data, log_time_ns, publish_time_ns = record
        number = self._channels.get(channel)
        if number is None:
            self.add_channel(channel)
            number = self._channels[channel]
        self.counts[channel.topic] += 1
        self._counts[channel] += 1
        try:
            self._file.write(number, data, log_time_ns, publish_time_ns, sequence)
        except BagError:
            self.failed = True
            raise
        self.flush_if_due()

    def copy_records(self, scan: FileScan) -> None:
        """Append the attachments and metadata records that were found in another file."""
        with scan.opened() as window:
            for offset, length in scan.copied:
                self._file.copy_record(window, offset, length)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Append a metadata record to the present file."""
        try:
            self._file.add_metadata(name, values)
        except BagError:
            self.failed = True
            raise

    def start_file(self, profile: str) -> None:
        """End the present file and begin the next one."""
        self._profile = profile
        self._finish_file()
        following = self._next_file()
        self._finished_bytes += self._file.size
        self._file = following

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
                self.start_file(self._profile)
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
            text = yaml_text({ROOT_KEY: self._metadata(self._finished)})
            atomic_write_text(self.directory / FILE_NAME, text)
        except FileError:
            self.failed = True
            self._abandon()
            raise

    def _abandon(self) -> None:
        """Close without a summary, as after a crash; `counts` are then those on the disk."""
        unwritten = self._file.unwritten if self._file.is_open else {}
        for channel, number in self._channels.items():
            self.counts[channel.topic] -= unwritten.get(number, 0)
        self._file.close()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next_file(self) -> McapWriter:
        path = self.directory / f"{self.directory.name}_{len(self._finished)}.mcap"
        file = McapWriter(
            path, compression=self._compression, sync=self._sync, profile=self._profile
        )
        self._channels = {channel: file.add_channel(channel) for channel in self._channels}
        return file

    def _finish_file(self) -> None:
        self._file.flush()
        files = [*self._finished, self._file.span]
        text = flow_yaml_text(self._metadata(files))
        self._file.finish(ROS2_RECORD, {"serialized_metadata": text})
        self._finished = files

    def _metadata(self, files: list[FileSpan]) -> dict[str, object]:
        channels = [(channel, self._counts[channel]) for channel in self._channels]
        return bag_metadata(files, channels, self.kept)


def require_new_folder(directory: Path) -> None:
    """BagError where the folder of a new bag is not empty, or a file stands in its place."""
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise BagError(f"bag folder {directory} must be new or empty; choose another name")


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """The folder of a new bag, which appears under its name only once it is complete.

    It is written under the same name inside a hidden folder beside it and then moved; it is removed
    where writing failed. What a killed process leaves is hidden.

    BagError where `target` is not empty or the disk cannot be written.
    """
    target = target.resolve()
    with disk_errors("write", target, BagError):
        target.parent.mkdir(parents=True, exist_ok=True)
        require_new_folder(target)
        hidden = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        try:
            filling = hidden / target.name
            yield filling
            filling.replace(target)
        finally:
            shutil.rmtree(hidden, ignore_errors=True)
