"""Messages of any rosbag2, MCAP or sqlite3, plain or compressed, with all that is wrong with it.

The order is that of the files; log times step back where the recorder received them so.
"""

import weakref
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from bags.errors import BagError
from bags.health.damage import Damage
from bags.health.losses import FileCount, Losses, losses
from bags.mcap.definitions import Definitions
from bags.mcap.ending import file_ending
from bags.mcap.scan import McapScan
from bags.rosbag2.layout import BagLayout, bag_layout
from bags.rosbag2.packed_messages import PackedMessages
from bags.rosbag2.raw_message import RawMessage as RawMessage
from bags.rosbag2.topic_info import TopicInfo as TopicInfo
from bags.rosbag2.unpacked import UnpackedFiles
from bags.sqlite.scan import SqliteScan
from storage.nearest import nearest_name


class BagReader:
    """Reads a bag folder, or a single file of one.

    tolerant: go on past damage and keep it in `damage`; otherwise damage is a BagError, raised
    when it is met, which for missing messages is at the end.
    thorough: hold the index of messages against the messages too.
    losses: what is missing, once all messages were read.
    """

    def __init__(self, path: str | Path, *, tolerant: bool = False, thorough: bool = False) -> None:
        self.path = Path(path)
        self.tolerant = tolerant
        self.damage: list[Damage] = []
        self.losses = Losses()
        self.layout: BagLayout = bag_layout(path)
        self._thorough = thorough
        self._unpacked = UnpackedFiles(self.layout.files)
        weakref.finalize(self, self._unpacked.close)
        if self.layout.fault:
            self._take([Damage(self.path, None, self.layout.fault)])
        self._take(self._unpacked.damage)
        self.topics: dict[str, TopicInfo] = {topic.name: topic for topic in self._topics()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        wanted = None if topics is None else frozenset(topics)
        counts: Counter[str] = Counter()
        files: list[FileCount] = []
        for file, path in zip(self.layout.files, self._unpacked.paths, strict=True):
            scan = self._scan(path)
            found = _of_mcap(scan, wanted) if isinstance(scan, McapScan) else scan.messages(wanted)
            packed = PackedMessages(found)
            yield from packed.messages()
            files.append(FileCount(file, scan.counts.total() - packed.n_broken, scan.expected))
            counts.update(scan.counts)
            self._take([replace(each, path=file) for each in scan.damage])
            if packed.n_broken:
                what = f"{packed.n_broken} compressed messages cannot be unpacked"
                self._take([Damage(file, None, what)])
        self.losses = losses(self.layout, files)
        self._hold_against_metadata(counts)

    def _scan(self, path: Path) -> McapScan | SqliteScan:
        if path.suffix == ".mcap":
            return McapScan(path, thorough=self._thorough)
        return SqliteScan(path)

    def _hold_against_metadata(self, found: Counter[str]) -> None:
        """The files may be sound and yet not hold what was recorded."""
        if self.damage:
            return
        told = self.layout.messages_by_topic
        wrong = [
            f"metadata.yaml tells of {told.get(name, 0)} messages on {name},"
            f" the files hold {found[name]}"
            for name in sorted({*told, *found})
            if told and told.get(name, 0) != found[name]
        ]
        whole = self.layout.n_messages
        if not wrong and whole is not None and whole != found.total():
            wrong = [f"metadata.yaml tells of {whole} messages, the files hold {found.total()}"]
        self._take([Damage(self.path, None, what) for what in wrong])

    def _take(self, damage: list[Damage]) -> None:
        if damage and not self.tolerant:
            raise BagError(f"{damage[0].sentence()}; repair it with 'serd bag recover'")
        self.damage.extend(damage)

    def _topics(self) -> Iterator[TopicInfo]:
        for file, path in zip(self.layout.files, self._unpacked.paths, strict=True):
            if path.suffix != ".mcap":
                yield from self._topics_of_database(file, path)
                continue
            ending = file_ending(path)
            if ending is not None and ending.names_topics:
                yield from _topics_of(ending.definitions)
            else:
                yield from _topics_of(self._scanned(file, path))

    def _topics_of_database(self, file: Path, path: Path) -> Iterator[TopicInfo]:
        scan = SqliteScan(path)
        found = scan.topics()
        if not found and not self.tolerant:
            self._take([Damage(file, None, scan.fault() or "it names no topic")])
        yield from found.values()

    def _scanned(self, file: Path, path: Path) -> Definitions:
        """What a file defines whose end is brief, or missing, which strictly is damage."""
        scan = McapScan(path)
        for _ in scan.messages(frozenset()):
            pass
        if not self.tolerant:
            self._take([replace(each, path=file) for each in scan.damage])
        return scan.definitions


def topic_named(topics: Collection[str], name: str) -> str:
    """The one topic of that name; BagError where there is none or more than one."""
    found = topics_named(topics, name)
    if len(found) == 1:
        return found[0]
    known = ", ".join(sorted(found or topics)) or "nothing"
    if found:
        raise BagError(f"topic {name!r} must be one topic, the bag holds {known}; name it in full")
    fix = nearest_topic(topics, name)
    fix = f"did you mean {fix!r}?" if fix else "record it too"
    raise BagError(f"bag must hold the topic {name!r}, it holds {known}; {fix}")


def topics_named(topics: Collection[str], name: str) -> list[str]:
    """The topic itself where it is there, else all of that name in some namespace.

    A name that begins with "/" is whole, as everywhere in ROS.
    """
    if name in topics:
        return [name]
    return [] if name.startswith("/") else [each for each in topics if each.endswith(f"/{name}")]


def nearest_topic(topics: Collection[str], name: str) -> str | None:
    """The topic whose name, whole or without its namespace, is most like `name`."""
    whole = {topic: topic for topic in sorted(topics)}
    short = {topic.rsplit("/", 1)[-1]: topic for topic in sorted(topics)}
    near = nearest_name(name, {**short, **whole})
    return None if near is None else {**short, **whole}[near]


def _of_mcap(scan: McapScan, wanted: frozenset[str] | None) -> Iterator[RawMessage]:
    types: dict[int, str] = {}
    for channel, log_time_ns, publish_time_ns, data in scan.messages(wanted):
        name = types.get(channel.schema_id)
        if name is None:
            name = types[channel.schema_id] = _type_name(scan.definitions, channel.schema_id)
        yield RawMessage(channel.topic, name, data, log_time_ns, publish_time_ns)


def _topics_of(definitions: Definitions) -> Iterator[TopicInfo]:
    for channel in definitions.channels.values():
        schema = definitions.schemas.get(channel.schema_id)
        metadata = dict(channel.metadata)
        yield TopicInfo(
            name=channel.topic,
            type_name=schema.name if schema else "",
            text=schema.text if schema else "",
            type_hash=metadata.get("topic_type_hash", ""),
            qos=metadata.get("offered_qos_profiles", ""),
            encoding=channel.encoding,
            text_encoding=schema.encoding if schema else "",
        )


def _type_name(definitions: Definitions, schema_id: int) -> str:
    schema = definitions.schemas.get(schema_id)
    return schema.name if schema else ""
