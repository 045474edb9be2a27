"""Messages of a bag as text: JSON lines, or CSV with columns of fields."""

import base64
import csv
import io
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from typing import Any

from serd_bag.errors import BagError
from serd_bag.formats.rosbag2.message_types import store_of
from serd_bag.messages.plain import decode
from serd_bag.reader import BagReader, message_of, topic_read
from serd_bag.topic import CDR, Channel, RawMessage, Topic
from serd_bag.verbs.cut import Selection


def json_lines(reader: BagReader, selection: Selection) -> Iterator[str]:
    """One JSON object per message: topic, type, both times in ns, and the message.

    Messages that cannot be read here are given as base64.
    """
    for message, value in _values(reader, selection):
        yield json.dumps(
            {
                "topic": message.topic,
                "type": message.type_name,
                "log_time_ns": message.log_time_ns,
                "publish_time_ns": message.publish_time_ns,
                "message": value,
            },
            ensure_ascii=False,
        )


def csv_lines(reader: BagReader, selection: Selection, columns: Sequence[str]) -> Iterator[str]:
    """CSV with topic, log time in ns and these fields, as `pose.position.x`; empty where a message
    has none."""
    yield _row(["topic", "log_time_ns", *columns])
    for message, value in _values(reader, selection):
        found = [_field(value, column) for column in columns]
        yield _row([message.topic, message.log_time_ns, *found])


def _values(reader: BagReader, selection: Selection) -> Iterator[tuple[RawMessage, Any]]:
    stores: dict[Channel, Any] = {}
    for record in selection.records(reader):
        channel, data = record.channel, record.data
        topic = topic_read(channel)
        if channel not in stores:
            stores[channel] = _store(topic)
        message = message_of(record)
        if channel.encoding == "json":
            value = json.loads(data)
        elif stores[channel] is None or message is None:
            value = {"base64": base64.b64encode(data).decode()}
        else:
            value = _plain(decode(message.data, message.type_name, stores[channel]))
        yield message or RawMessage(topic.name, topic.type_name, *record[2:]), value


def _store(topic: Topic) -> Any:
    with suppress(BagError):
        return store_of(topic) if topic.encoding == CDR else None
    return None


def _plain(value: Any) -> Any:
    """The value without classes and arrays; numbers that JSON has not become texts."""
    if is_dataclass(value):
        names = (each.name for each in fields(value))
        return {name: _plain(getattr(value, name)) for name in names if name != "__msgtype__"}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and value - value != 0:
        return str(value)
    return value


def _field(value: Any, path: str) -> Any:
    for name in path.split("."):
        if isinstance(value, dict):
            value = value.get(name)
        elif isinstance(value, list) and name.isdecimal() and int(name) < len(value):
            value = value[int(name)]
        else:
            return ""
    return "" if value is None else value


def _row(values: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(values)
    return text.getvalue()
