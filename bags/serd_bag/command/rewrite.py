"""A bag as a new bag: `recover` keeps what a damaged one still holds, `convert` writes MCAP.

The new bag appears under its name only once it is complete: it is written under the same name
inside a hidden folder beside it and then moved. What a killed process leaves is hidden.
"""

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.mcap.writer import Compression
from serd_bag.formats.rosbag2.message_types import resolve_type_if_known
from serd_bag.reader import BagReader
from serd_bag.topic import CDR
from serd_bag.writer import BagWriter, require_new_folder


@dataclass(frozen=True)
class RewriteReport:
    """The result of `recover` or `convert`.

    counts: messages in the new bag per topic; damage: sentences, in order.
    skipped: topics left out and why; left_out: their messages.
    n_lost: messages known to be lost, None where the bag has no count of them.
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
    """Write what is still readable of a bag as a new bag, uncompressed; `source` stays as it is.

        report = recover("drive", "drive_recovered")
        print(report.n_messages, report.n_lost)

    target: a folder that is new or empty, else BagError; also where there is no bag.
    """
    return _rewrite(BagReader(source, tolerant=True, thorough=True), Path(target), "none")


def convert(
    source: str | Path, target: str | Path, *, compression: Compression = "none"
) -> RewriteReport:
    """Write any sound bag as an MCAP bag; arguments and errors are those of `recover`.

    compression: of the chunks. BagError also where `check_bag` finds `source` damaged.
    """
    return _rewrite(BagReader(source, thorough=True), Path(target), compression)


def _rewrite(reader: BagReader, target: Path, compression: Compression) -> RewriteReport:
    skipped = {
        topic.name: f"its messages are {topic.encoding}, not {CDR}"
        for topic in reader.topics.values()
        if topic.encoding != CDR
    }
    left_out: Counter[str] = Counter()
    with _new_folder(target) as folder, BagWriter(folder, compression=compression) as writer:
        for name, topic in reader.topics.items():
            if name not in skipped:
                writer.add_topic(name, resolve_type_if_known(topic.message_type), topic.qos)
        for name, _, data, log_time_ns, publish_time_ns in reader.messages():
            if name in skipped:
                left_out[name] += 1
            else:
                writer.write(name, data, log_time_ns, publish_time_ns)
        for path, spans in reader.copied:
            writer.copy_records(path, spans)
    lost = reader.losses
    counted = lost.n_messages or lost.all_known or not reader.damage
    return RewriteReport(
        source=reader.path,
        target=target.resolve(),
        counts=dict(writer.counts),
        skipped=skipped,
        left_out={name: left_out[name] for name in skipped},
        damage=tuple(each.sentence() for each in reader.damage),
        n_lost=lost.n_messages if counted else None,
        all_lost_known=lost.all_known or not reader.damage,
    )


@contextmanager
def _new_folder(target: Path) -> Iterator[Path]:
    """The folder to write; moved to `target` at the end, removed where writing failed.

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
