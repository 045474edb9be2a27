"""Messages of any rosbag2: MCAP by our own checking walk, everything else by rosbags.

The order is that of the files; log times step back where the recorder received them so.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from bags.damage import Damage
from bags.errors import BagError
from bags.layout import BagLayout, bag_layout
from bags.mcap_definitions import Definitions
from bags.mcap_ending import file_ending
from bags.mcap_scan import McapScan
from bags.rosbags_source import RosbagsSource


class RawMessage(NamedTuple):
    """data: CDR bytes as recorded."""

    topic: str
    type_name: str
    data: bytes
    log_time_ns: int
    publish_time_ns: int


@dataclass(frozen=True)
class TopicInfo:
    """text, type_hash: empty where the bag does not hold them; qos: YAML text as in the bag."""

    name: str
    type_name: str
    text: str = ""
    type_hash: str = ""
    qos: str = ""


class BagReader:
    """Reads a bag folder, or a single file of one.

    tolerant: go on past damage and keep it in `damage`; otherwise damage is a BagError, raised
    when it is met, which for missing messages is at the end.
    """

    def __init__(self, path: str | Path, *, tolerant: bool = False) -> None:
        self.path = Path(path)
        self.tolerant = tolerant
        self.damage: list[Damage] = []
        self.layout: BagLayout = bag_layout(path)
        self._other = None if self.layout.plain_mcap else RosbagsSource(self.layout)
        if self.layout.fault:
            self._take([Damage(self.path, 0, self.layout.fault)])
        self.topics: dict[str, TopicInfo] = {topic.name: topic for topic in self._topics()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Messages of the given topics, None for all."""
        wanted = None if topics is None else frozenset(topics)
        if self._other is not None:
            for found in self._other.messages(wanted):
                yield RawMessage(*found)
            return
        scans = [McapScan(file) for file in self.layout.files]
        for scan in scans:
            yield from self._of_file(scan, wanted)
        self._hold_against_metadata(sum(scan.n_messages for scan in scans))

    def _of_file(self, scan: McapScan, wanted: frozenset[str] | None) -> Iterator[RawMessage]:
        types: dict[int, str] = {}
        for channel, log_time_ns, publish_time_ns, data in scan.messages(wanted):
            name = types.get(channel.schema_id)
            if name is None:
                name = types[channel.schema_id] = _type_name(scan.definitions, channel.schema_id)
            yield RawMessage(channel.topic, name, data, log_time_ns, publish_time_ns)
        self._take(scan.damage)

    def _hold_against_metadata(self, found: int) -> None:
        """The files may be sound and yet not those that belong to the bag."""
        expected = (self.layout.metadata or {}).get("message_count", found)
        if found != expected and not self.damage:
            what = f"metadata.yaml tells of {expected} messages, the files hold {found}"
            self._take([Damage(self.path, 0, what)])

    def _take(self, damage: list[Damage]) -> None:
        if damage and not self.tolerant:
            raise BagError(f"{damage[0].sentence()}; repair it with 'serd bag recover'")
        self.damage.extend(damage)

    def _topics(self) -> Iterator[TopicInfo]:
        if self._other is not None:
            for name, type_name, text, type_hash, qos in self._other.topics():
                yield TopicInfo(name, type_name, text, type_hash, qos)
            return
        for file in self.layout.files:
            ending = file_ending(file)
            yield from _topics_of(self._scanned(file) if ending is None else ending.definitions)

    def _scanned(self, file: Path) -> Definitions:
        """What a file without an end defines; strictly that is damage already."""
        scan = McapScan(file)
        for _ in scan.messages(frozenset()):
            pass
        if not self.tolerant:
            self._take(scan.damage)
        return scan.definitions


def topic_named(topics: Collection[str], name: str) -> str:
    """The topic of that name in any namespace; BagError where there is none or more than one."""
    found = topics_named(topics, name)
    if len(found) == 1:
        return found[0]
    known = ", ".join(sorted(found or topics)) or "nothing"
    if found:
        raise BagError(f"topic {name!r} must be one topic, the bag holds {known}; name it in full")
    raise BagError(f"bag must hold the topic {name!r}, it holds {known}; record it too")


def topics_named(topics: Collection[str], name: str) -> list[str]:
    """The topic itself where it is there, else all of that name in some namespace."""
    if name in topics:
        return [name]
    return [topic for topic in topics if topic.rsplit("/", 1)[-1] == name.lstrip("/")]


def _topics_of(definitions: Definitions) -> Iterator[TopicInfo]:
    for channel in definitions.channels.values():
        schema = definitions.schemas.get(channel.schema_id)
        metadata = dict(channel.metadata)
        yield TopicInfo(
            name=channel.topic,
            type_name=schema.name if schema else "",
            text=schema.text if schema and schema.encoding == "ros2msg" else "",
            type_hash=metadata.get("topic_type_hash", ""),
            qos=metadata.get("offered_qos_profiles", ""),
        )


def _type_name(definitions: Definitions, schema_id: int) -> str:
    schema = definitions.schemas.get(schema_id)
    return schema.name if schema else ""
