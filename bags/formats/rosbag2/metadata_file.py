"""metadata.yaml of a rosbag2 directory, version 9 (Jazzy)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from bags.topic import Topic

VERSION = 9
FILE_NAME = "metadata.yaml"
ROOT_KEY = "rosbag2_bagfile_information"
ROS_DISTRO = "jazzy"
_NO_TIME_NS = 2**63 - 1


@dataclass(frozen=True)
class FileSpan:
    """Messages of one storage file and the log times they span, None where it has none."""

    name: str
    n_messages: int
    first_ns: int | None = None
    last_ns: int | None = None


def bag_metadata(files: Sequence[FileSpan], topics: Sequence[tuple[Topic, int]]) -> dict[str, Any]:
    """Values below the root key; topics come with their number of messages."""
    filled = [span for span in files if span.first_ns is not None and span.last_ns is not None]
    first = min((span.first_ns or 0 for span in filled), default=None)
    last = max((span.last_ns or 0 for span in filled), default=None)
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_times(first, last),
        "message_count": sum(span.n_messages for span in files),
        "topics_with_message_count": [_topic(topic, count) for topic, count in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [span.name for span in files],
        "files": [_file(span) for span in files],
        "custom_data": None,
        "ros_distro": ROS_DISTRO,
    }


def metadata_text(values: Mapping[str, Any]) -> str:
    """YAML text, as in metadata.yaml and in the MCAP record `rosbag2`."""
    return yaml.safe_dump(dict(values), sort_keys=False, default_flow_style=False)


def _topic(topic: Topic, count: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.message_type.name,
            "serialization_format": "cdr",
            "offered_qos_profiles": [profile.values() for profile in topic.qos],
            "type_description_hash": topic.message_type.type_hash,
        },
        "message_count": count,
    }


def _file(span: FileSpan) -> dict[str, Any]:
    times = _times(span.first_ns, span.last_ns)
    return {
        "path": span.name,
        "starting_time": times["starting_time"],
        "duration": times["duration"],
        "message_count": span.n_messages,
    }


def _times(first_ns: int | None, last_ns: int | None) -> dict[str, Any]:
    start = _NO_TIME_NS if first_ns is None else first_ns
    duration = (last_ns or 0) - (first_ns or 0)
    return {
        "duration": {"nanoseconds": duration},
        "starting_time": {"nanoseconds_since_epoch": start},
    }
