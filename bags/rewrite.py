"""A bag written anew: `recover` keeps what a broken one still holds, `convert` any as MCAP.

The new bag stands under its name only once it is whole.
"""

from dataclasses import dataclass
from pathlib import Path

from bags.errors import BagError
from bags.mcap_writer import Compression
from bags.message_types import MessageType, message_type
from bags.qos_text import qos_of_text
from bags.reader import BagReader, TopicInfo
from bags.whole_folder import whole_folder
from bags.writer import BagWriter


@dataclass(frozen=True)
class RewriteReport:
    """counts: messages per topic; skipped: topics left out and why; damage: sentences, in order.

    n_lost: messages known to be lost, None where the broken file cannot tell.
    """

    source: Path
    target: Path
    counts: dict[str, int]
    skipped: dict[str, str]
    damage: tuple[str, ...]
    n_lost: int | None

    @property
    def n_messages(self) -> int:
        """Messages in the new bag."""
        return sum(self.counts.values())


def recover(source: str | Path, target: str | Path) -> RewriteReport:
    """Write what is still readable of `source` as a new bag."""
    return _rewrite(BagReader(source, tolerant=True), Path(target), "none", None)


def convert(
    source: str | Path,
    target: str | Path,
    *,
    compression: Compression = "none",
    max_file_bytes: int | None = None,
) -> RewriteReport:
    """Write any sound bag as an MCAP bag; BagError where `source` is damaged."""
    return _rewrite(BagReader(source), Path(target), compression, max_file_bytes)


def _rewrite(
    reader: BagReader, target: Path, compression: Compression, max_file_bytes: int | None
) -> RewriteReport:
    skipped: dict[str, str] = {}
    with (
        whole_folder(target) as folder,
        BagWriter(folder, compression=compression, max_file_bytes=max_file_bytes) as writer,
    ):
        for topic in reader.topics.values():
            why_not = _add(writer, topic)
            if why_not:
                skipped[topic.name] = why_not
        for topic_name, _, data, log_time_ns, publish_time_ns in reader.messages(writer.topics):
            writer.write(topic_name, data, log_time_ns, publish_time_ns)
    lost = [each.lost_messages for each in reader.damage if each.lost_messages is not None]
    return RewriteReport(
        source=reader.path,
        target=target.resolve(),
        counts=dict(writer.counts),
        skipped=skipped,
        damage=tuple(each.sentence() for each in reader.damage),
        n_lost=sum(lost) if lost or not reader.damage else None,
    )


def _add(writer: BagWriter, topic: TopicInfo) -> str:
    """Add the topic; why it cannot be, empty where it was."""
    try:
        writer.add_topic(topic.name, topic.type_name, qos_of_text(topic.qos), definition_of(topic))
    except BagError as error:
        return str(error)
    return ""


def definition_of(topic: TopicInfo) -> MessageType:
    """The definition the bag holds, the installed one where it holds none."""
    if topic.text and topic.type_hash:
        return MessageType(topic.type_name, topic.text, topic.type_hash)
    return message_type(topic.type_name)
