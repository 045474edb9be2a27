"""Bags our own walk does not read (sqlite3, compressed files) by way of the rosbags library."""

import sqlite3
from collections.abc import Iterator
from typing import Any

import yaml
from rosbags.interfaces import ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import Reader, ReaderError

from bags.errors import BagError
from bags.layout import BagLayout

_FAULTS = (ReaderError, OSError, sqlite3.Error, ValueError, KeyError, AssertionError, EOFError)


class RosbagsSource:
    """One bag; opened for each question."""

    def __init__(self, layout: BagLayout) -> None:
        self._path = layout.path if layout.metadata is not None else layout.files[0]
        if layout.metadata is None and len(layout.files) > 1:
            raise BagError(
                f"bag {layout.path} must have its metadata.yaml, since it has several files"
                "; give one of the files"
            )

    def messages(self, topics: frozenset[str] | None) -> Iterator[tuple[str, str, bytes, int, int]]:
        """(topic, type, data, log time, the same) of the given topics, None for all."""
        with self._opened() as reader:
            chosen = [each for each in reader.connections if topics is None or each.topic in topics]
            if not chosen:
                return
            try:
                for connection, time_ns, data in reader.messages(connections=chosen):
                    yield connection.topic, connection.msgtype, bytes(data), time_ns, time_ns
            except _FAULTS as error:
                raise self._unreadable(error) from None

    def topics(self) -> list[tuple[str, str, str, str, str]]:
        """(topic, type, definition, type hash, QoS) of each topic."""
        with self._opened() as reader:
            return [
                (each.topic, each.msgtype, _definition(each), each.digest or "", _qos(each))
                for each in reader.connections
            ]

    def _opened(self) -> Any:
        try:
            reader = Reader(self._path)
            reader.open()
        except _FAULTS as error:
            raise self._unreadable(error) from None
        return _Opened(reader)

    def _unreadable(self, error: Exception) -> BagError:
        return BagError(f"bag {self._path} cannot be read ({error}); was it closed properly?")


class _Opened:
    def __init__(self, reader: Reader) -> None:
        self._reader = reader

    def __enter__(self) -> Reader:
        return self._reader

    def __exit__(self, *_: object) -> None:
        self._reader.close()


def _definition(connection: Any) -> str:
    definition = connection.msgdef
    return str(definition.data) if definition.format == MessageDefinitionFormat.MSG else ""


def _qos(connection: Any) -> str:
    """Names and depth of each profile; the rest is what everybody leaves at its default."""
    if not isinstance(connection.ext, ConnectionExtRosbag2):
        return ""
    values = [
        {
            "history": profile.history.name.lower(),
            "depth": profile.depth,
            "reliability": profile.reliability.name.lower(),
            "durability": profile.durability.name.lower(),
        }
        for profile in connection.ext.offered_qos_profiles
    ]
    return yaml.safe_dump(values, sort_keys=False) if values else ""
