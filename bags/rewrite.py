"""A bag written anew: `recover` keeps what a broken one still holds, `convert` any as MCAP.

The new bag stands under its name only once it is whole.
"""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from bags.mcap.writer import Compression
from bags.reader import BagReader
from bags.rosbag2.qos import qos_of_text
from bags.rosbag2.topic_definition import kept_definition
from bags.whole_folder import whole_folder
from bags.writer import BagWriter

_CDR = "cdr"


@dataclass(frozen=True)
class RewriteReport:
    """counts: messages per topic; damage: sentences, in order.

    skipped: topics left out and why; left_out: their messages.
    n_lost: messages known to be lost, None where the broken bag cannot tell of any.
    all_lost_known: whether no more than those can be lost.
    """

    source: Path
    target: Path
    counts: dict[str, int]
    skipped: dict[str, str]
    left_out: dict[str, int]
    damage: tuple[str, ...]
    n_lost: int | None
    all_lost_known: bool

    @property
    def n_messages(self) -> int:
        """Messages in the new bag."""
        return sum(self.counts.values())

    @property
    def n_left_out(self) -> int:
        """Readable messages that are not in the new bag."""
        return sum(self.left_out.values())


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
    skipped = {
        topic.name: f"its messages are {topic.encoding}, not {_CDR}"
        for topic in reader.topics.values()
        if topic.encoding != _CDR
    }
    left_out: Counter[str] = Counter()
    with (
        whole_folder(target) as folder,
        BagWriter(folder, compression=compression, max_file_bytes=max_file_bytes) as writer,
    ):
        for name, topic in reader.topics.items():
            if name not in skipped:
                profiles = qos_of_text(topic.qos)
                writer.add_topic(name, topic.type_name, profiles, kept_definition(topic))
        for name, _, data, log_time_ns, publish_time_ns in reader.messages():
            if name in skipped:
                left_out[name] += 1
            else:
                writer.write(name, data, log_time_ns, publish_time_ns)
    lost = reader.losses
    tells = lost.n_messages or lost.all_known or not reader.damage
    return RewriteReport(
        source=reader.path,
        target=target.resolve(),
        counts=dict(writer.counts),
        skipped=skipped,
        left_out={name: left_out[name] for name in skipped},
        damage=tuple(each.sentence() for each in reader.damage),
        n_lost=lost.n_messages if tells else None,
        all_lost_known=lost.all_known or not reader.damage,
    )
