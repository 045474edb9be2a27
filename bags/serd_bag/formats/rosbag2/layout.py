"""Which files make up a bag, and its metadata.yaml: read in any version, or missing; written in
version 9 (Jazzy).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serd_bag.errors import BagError, FileError, disk_errors
from serd_bag.files import read_text
from serd_bag.formats.limits import yaml_values
from serd_bag.formats.rosbag2.qos import qos_values
from serd_bag.topic import QOS, TYPE_HASH, Channel

COMPRESSED_FILE, _UNFINISHED_FILE = ".zstd", ".active"
_SUFFIXES = (".mcap", ".db3")
_ENDINGS = (*_SUFFIXES, *(suffix + COMPRESSED_FILE for suffix in _SUFFIXES))
#: Of ROS 1: one file without metadata.yaml.
ROS1_SUFFIX = ".bag"
#: First bytes of each kind of file.
MAGIC = {b"\x89MCAP0\r\n": ".mcap", b"SQLite format 3\0": ".db3", b"#ROSBAG V": ROS1_SUFFIX}
VERSION = 9
FILE_NAME = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
ROS_DISTRO = "jazzy"
_NO_TIME_NS = 2**63 - 1


@dataclass(frozen=True)
class BagLayout:
    """The files of a bag and what its metadata.yaml states.

    metadata: values below the root key of metadata.yaml, None where it cannot be read.

    fault: why metadata.yaml is missing or does not match the files, else empty.
    """

    path: Path
    files: tuple[Path, ...]
    metadata: dict[str, Any] | None
    fault: str = ""

    @property
    def n_messages(self) -> int | None:
        """Messages of the whole bag."""
        return _count((self.metadata or {}).get("message_count"))

    @property
    def messages_by_file(self) -> dict[str, int]:
        """Messages of each file, by its name without the suffix of compressed files."""
        entries = _dicts((self.metadata or {}).get("files"))
        counts = {str(each.get("path")): _count(each.get("message_count")) for each in entries}
        return {storage_name(name): count for name, count in counts.items() if count is not None}

    @property
    def messages_by_topic(self) -> dict[str, int]:
        """Messages of each topic."""
        counts: dict[str, int] = {}
        for entry in _dicts((self.metadata or {}).get("topics_with_message_count")):
            topic, count = entry.get("topic_metadata"), _count(entry.get("message_count"))
            if isinstance(topic, dict) and count is not None:
                name = str(topic.get("name"))
                counts[name] = counts.get(name, 0) + count
        return counts


def is_bag_file(path: Path) -> bool:
    """Whether the name is that of a storage file, also of one that is still recorded."""
    return path.name.removesuffix(_UNFINISHED_FILE).endswith((*_ENDINGS, ROS1_SUFFIX))


def storage_kind(path: Path) -> str:
    """`.mcap`, `.db3` or `.bag`: the kind of a file by its first bytes, else by its name."""
    return _kind_of_content(path) or Path(path.name.removesuffix(_UNFINISHED_FILE)).suffix


def is_recording(path: Path) -> bool:
    """Whether a file begins as a recording does."""
    return bool(_kind_of_content(path))


def _kind_of_content(path: Path) -> str:
    with disk_errors("read", path, BagError), path.open("rb") as stream:
        head = stream.read(16)
    return next((kind for magic, kind in MAGIC.items() if head.startswith(magic)), "")


def bag_layout(path: str | Path) -> BagLayout:
    """The layout of a bag folder or of a single storage file; BagError where there is no bag."""
    path = Path(path)
    if path.is_file() and is_bag_file(path):
        return BagLayout(path, (path,), None)
    if not path.is_dir():
        raise BagError(f"bag {path} must be a folder or a .mcap, .db3 or .bag file; check the path")
    metadata = None
    try:
        metadata = _metadata(path)
        return BagLayout(path, _listed(path, metadata), metadata)
    except FileError as error:
        files = _found(path)
        if not files:
            kinds = " or ".join(_SUFFIXES)
            ros1 = sorted(path.glob(f"*{ROS1_SUFFIX}"))
            if ros1:
                raise BagError(
                    f"bag {path} must be a folder of {kinds} files, it holds bags of ROS 1; give"
                    f" each of them, as {ros1[0]}"
                ) from None
            raise BagError(f"bag {path} must hold {kinds} files, got none; {error}") from None
        return BagLayout(path, files, metadata, str(error))


def anything_layout(path: str | Path) -> BagLayout:
    """The layout of a bag, or else of any file or of all files of a folder."""
    path = Path(path)
    try:
        return bag_layout(path)
    except BagError:
        files = (path,) if path.is_file() else tuple(sorted(filter(Path.is_file, path.rglob("*"))))
        if not files:
            raise
        return BagLayout(path, files, None)


def storage_name(path: Path | str) -> str:
    """The name of a storage file without the suffix of compressed files."""
    return Path(path).name.removesuffix(COMPRESSED_FILE)


def _metadata(path: Path) -> dict[str, Any]:
    text = read_text(path / FILE_NAME)
    try:
        content = yaml_values(text)
        values = content.get(ROOT_KEY) if isinstance(content, dict) else None
        if not isinstance(values, dict):
            raise BagError(f"it must have the key {ROOT_KEY} with keys and values")
        names = values.get("relative_file_paths")
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise BagError("relative_file_paths must be a list of names")
    except BagError as error:
        reason = str(error).splitlines()[0]
        raise BagError(f"{path / FILE_NAME} is no rosbag2 metadata ({reason})") from None
    return dict(values)


def _listed(path: Path, metadata: dict[str, Any]) -> tuple[Path, ...]:
    names = [Path(name).name for name in metadata["relative_file_paths"]]
    files = tuple(path / name for name in dict.fromkeys(names))
    missing = [file.name for file in files if not file.is_file()]
    if missing:
        raise BagError(f"{path / FILE_NAME} lists {missing[0]}, which is missing")
    unlisted = sorted({file.name for file in _found(path)} - {file.name for file in files})
    if unlisted:
        raise BagError(f"{path / FILE_NAME} does not list {unlisted[0]}")
    if len(files) < len(names):
        raise BagError(f"{path / FILE_NAME} lists a file twice")
    return files


def _found(path: Path) -> tuple[Path, ...]:
    files = (file for file in path.iterdir() if file.name.endswith(_ENDINGS))
    return tuple(sorted(files, key=_by_number))


def _by_number(file: Path) -> tuple[int, str]:
    number = re.search(r"_(\d+)$", Path(storage_name(file.name)).stem)
    return int(number[1]) if number else 0, file.name


def _dicts(values: Any) -> list[dict[str, Any]]:
    return [each for each in values if isinstance(each, dict)] if isinstance(values, list) else []


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and value >= 0 else None


@dataclass(frozen=True)
class FileSpan:
    """Messages of one storage file and the log times they span, None where it has none."""

    name: str
    n_messages: int
    first_ns: int | None = None
    last_ns: int | None = None


def bag_metadata(
    files: Sequence[FileSpan],
    channels: Sequence[tuple[Channel, int]],
    kept: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Values below the root key; channels come with their number of messages.

    kept: values of another bag of which custom_data and ros_distro are taken.
    """
    kept = kept or {}
    filled = [span for span in files if span.first_ns is not None and span.last_ns is not None]
    first = min((span.first_ns or 0 for span in filled), default=None)
    last = max((span.last_ns or 0 for span in filled), default=None)
    times = _times(first, last)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": times["duration"],
        "starting_time": times["starting_time"],
        "message_count": sum(span.n_messages for span in files),
        "topics_with_message_count": [
            {"topic_metadata": _topic_values(channel), "message_count": count}
            for channel, count in channels
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [span.name for span in files],
        "files": [
            {
                "path": span.name,
                **_times(span.first_ns, span.last_ns),
                "message_count": span.n_messages,
            }
            for span in files
        ],
        "custom_data": kept.get("custom_data"),
        "ros_distro": kept.get("ros_distro", ROS_DISTRO),
    }


def _topic_values(channel: Channel) -> dict[str, Any]:
    return {
        "name": channel.topic,
        "type": channel.type_name,
        "serialization_format": channel.encoding,
        "offered_qos_profiles": qos_values(channel.value(QOS)),
        "type_description_hash": channel.value(TYPE_HASH),
    }


def _times(first_ns: int | None, last_ns: int | None) -> dict[str, Any]:
    start = _NO_TIME_NS if first_ns is None else min(first_ns, _NO_TIME_NS)
    duration = min(last_ns or 0, _NO_TIME_NS) - min(first_ns or 0, _NO_TIME_NS)
    return {
        "starting_time": {"nanoseconds_since_epoch": start},
        "duration": {"nanoseconds": duration},
    }
