"""`convert`: any sound bag as an MCAP bag of ROS 2."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from serd_bag.errors import BagError
from serd_bag.formats.mcap.writer import Compression
from serd_bag.formats.ros1.conversion import converted, converted_topic
from serd_bag.formats.rosbag2.message_types import resolve_type_if_known
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import kept_metadata
from serd_bag.topic import CDR, ROS1, TYPE_HASH, Channel, Record, topic_of
from serd_bag.writer import BagWriter, new_folder


@dataclass(frozen=True)
class RewriteReport:
    """The result of `convert`: messages in the new bag by topic."""

    source: Path
    target: Path
    counts: dict[str, int]
    damage: tuple[str, ...]

    @property
    def n_messages(self) -> int:
        """Messages in the new bag."""
        return sum(self.counts.values())


def convert(
    source: str | Path, target: str | Path, *, compression: Compression = "none"
) -> RewriteReport:
    """Write a bag as an MCAP bag; `source` stays as it is.

        report = convert("drive.bag", "drive_mcap")

    target: a folder that is new or empty. compression: of the chunks. Messages of ROS 1 become
    those of ROS 2 with the same fields, all others stay as they are; types without definition or
    hash get those that are installed. BagError also where `check_bag` finds messages of `source`
    damaged.
    """
    reader = BagReader(source, thorough=True)
    made = {channel: _converted(channel) for channel in reader.channels}
    with new_folder(Path(target)) as folder, BagWriter(folder, compression=compression) as writer:
        copy(reader, writer, list(made.values()), lambda record: _in_cdr(record, made))
    damage = tuple(each.sentence() for each in reader.damage)
    return RewriteReport(reader.path, Path(target).resolve(), dict(writer.counts), damage)


def copy(
    reader: BagReader,
    writer: BagWriter,
    channels: Sequence[Channel],
    change: Callable[[Record], Record],
) -> None:
    """Write all that a bag holds, and each message as `change` returns it."""
    for channel in channels:
        writer.add_channel(channel)
    for scan, records in reader.walks():
        for record in records:
            writer.write_record(change(record))
        writer.copy_records(scan)
    writer.kept = kept_metadata(reader)


def _converted(channel: Channel) -> Channel:
    """The channel of ROS 2 with all that is known of its type."""
    if channel.encoding == ROS1:
        return converted_topic(channel).channel
    if channel.encoding != CDR:
        return channel
    known = resolve_type_if_known(topic_of(channel).message_type)
    others = [pair for pair in channel.metadata if pair[0] != TYPE_HASH]
    return replace(
        channel,
        schema=known.text.encode(),
        schema_encoding=known.encoding,
        metadata=(*others, (TYPE_HASH, known.type_hash)),
    )


def _in_cdr(record: Record, made: dict[Channel, Channel]) -> Record:
    channel = record.channel
    if channel.encoding != ROS1:
        return record._replace(channel=made[channel])
    data = converted(channel, record.data)
    if data is None:
        raise BagError(
            f"a message on {channel.topic} must fit the definition of its type; save it as it is"
            " with 'serd-bag rescue'"
        )
    return record._replace(channel=made[channel], data=data)
