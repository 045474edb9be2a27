"""Broken recordings: messages that `serd-bag rescue`, the plain readers and rosbags save of each.

Every kind of damage is done to the bytes of one recording in each format. A message counts where
topic, log time and payload are those that were recorded, bit for bit; the others are wrong.
`rescue` marks what a damaged part seems to hold. Where a format has no checksums, as sqlite3, ROS 1
and MCAP without chunks, no reader can find changed bytes within a message. A plain reader is the
stream reader of `mcap`, SQLite itself, and a walk of twenty lines along the records of a ROS 1 bag;
rosbags gets the metadata.yaml of the sound bag.
"""

import csv
import sqlite3
import struct
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import cache
from io import BytesIO, StringIO
from pathlib import Path

import numpy as np
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapFileWriter
from rosbags import rosbag1, rosbag2
from rosbags.rosbag1.writer import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from lab import RESULTS
from lab.benchmarks.report import save
from serd_bag.errors import BagError
from serd_bag.files import atomic_write_text
from serd_bag.formats.limits import yaml_text
from serd_bag.formats.rosbag2.layout import (
    FILE_NAME,
    ROOT_KEY,
    FileSpan,
    bag_metadata,
)
from serd_bag.formats.rosbag2.message_types import message_type
from serd_bag.reader import BagReader
from serd_bag.rescue.saving import rescue
from serd_bag.topic import Topic

_TYPE = "std_msgs/msg/String"
_TOPICS = ("/odom", "/scan", "/tf", "/camera")
_N_MESSAGES, _CHUNK = 1500, 48 << 10
_START_NS, _PERIOD_NS = 1_700_000_000_000_000_000, 10_000_000
_ROS1 = ".bag"
#: topic, log time, payload
Message = tuple[str, int, bytes]
Damage = Callable[[bytes, np.random.Generator], bytes]
Writing = Callable[[Path, list[Message]], Path]


def _at(content: bytes, share: float) -> int:
    return int(len(content) * share)


def _set(content: bytes, place: int, wrong: bytes) -> bytes:
    return content[:place] + wrong + content[place + len(wrong) :]


def _overwritten(share: float, size: int, with_byte: int | None = None) -> Damage:
    """A block of bytes is zero, or another number, or anything; it begins at a page of the disk."""

    def damage(content: bytes, rng: np.random.Generator) -> bytes:
        place = _at(content, share) // 512 * 512
        wrong = rng.bytes(size) if with_byte is None else bytes([with_byte]) * size
        return _set(content, place, wrong[: len(content) - place])

    return damage


def _flipped(share: float, n_bits: int = 1) -> Damage:
    """Bits near that place, or `n_bits` anywhere, are wrong."""

    def damage(content: bytes, rng: np.random.Generator) -> bytes:
        found = bytearray(content)
        around = _at(content, share)
        for _ in range(n_bits):
            place = around if n_bits == 1 else int(rng.integers(len(content)))
            found[place] ^= 1 << int(rng.integers(8))
        return bytes(found)

    return damage


def _repeated(every: int, size: int) -> Damage:
    """A few bytes of every so many are zero."""

    def damage(content: bytes, _: np.random.Generator) -> bytes:
        found = bytearray(content)
        for place in range(every, len(content) - size, every):
            found[place : place + size] = bytes(size)
        return bytes(found)

    return damage


def _removed(share: float, size: int) -> Damage:
    return lambda content, _: content[: _at(content, share)] + content[_at(content, share) + size :]


def _inserted(share: float, size: int) -> Damage:
    return lambda content, rng: (
        content[: _at(content, share)] + rng.bytes(size) + content[_at(content, share) :]
    )


def _cut(share: float, tail: Callable[[bytes, np.random.Generator], bytes]) -> Damage:
    return lambda content, rng: content[: _at(content, share)] + tail(content, rng)


def _moved(content: bytes, _: np.random.Generator) -> bytes:
    one, other, size = _at(content, 0.3), _at(content, 0.6), 8192
    swapped = _set(content, one, content[other : other + size])
    return _set(swapped, other, content[one : one + size])


def _wrong_pointer(value: int) -> Damage:
    """The place that the end of an MCAP file, or the head of another one, states is `value`."""

    def damage(content: bytes, _: np.random.Generator) -> bytes:
        if content.startswith(b"\x89MCAP"):
            unchecked = _set(content, len(content) - 28, struct.pack("<Q", value))
            return _set(unchecked, len(content) - 12, bytes(4))
        if content.startswith(b"#ROSBAG"):
            return _set(content, content.index(b"index_pos=") + 10, struct.pack("<Q", value))
        return _set(content, 32, struct.pack(">II", value % 2**32, 3))

    return damage


def _footer_bit(content: bytes, _: np.random.Generator) -> bytes:
    """One bit of the pointer is wrong, and there is no checksum that would show it."""
    if not content.startswith(b"\x89MCAP"):
        return _set(content, 40, bytes([content[40] ^ 16]))
    unchecked = _set(content, len(content) - 12, bytes(4))
    return _set(unchecked, len(content) - 27, bytes([content[-27] ^ 4]))


def _nothing(_content: bytes, _rng: np.random.Generator) -> bytes:
    return b""


KINDS: dict[str, Damage] = {
    "none": lambda content, _: content,
    **{f"cut at {100 * share:.0f} %": _cut(share, _nothing) for share in (0.1, 0.5, 0.9, 0.99)},
    "last byte missing": lambda content, _: content[:-1],
    "cut, zeros behind": _cut(0.6, lambda content, _: bytes(len(content) - _at(content, 0.6))),
    "cut, noise behind": _cut(0.6, lambda _, rng: rng.bytes(20_000)),
    "cut, other file behind": _cut(0.6, lambda content, _: content[: _at(content, 0.2)]),
    **{f"bit at {100 * share:.0f} %": _flipped(share) for share in (0.02, 0.21, 0.5, 0.83)},
    "first byte wrong": lambda content, _: _set(content, 0, b"X"),
    "8 bits": _flipped(0.0, 8),
    "200 bits": _flipped(0.0, 200),
    "head zeroed": _overwritten(0.0, 512, 0),
    "first page zeroed": _overwritten(0.0, 4096, 0),
    "first 64 KiB zeroed": _overwritten(0.0, 65536, 0),
    "head missing": _removed(0.0, 4096),
    "sector zeroed": _overwritten(0.4, 512, 0),
    "page zeroed": _overwritten(0.4, 4096, 0),
    "64 KiB zeroed": _overwritten(0.4, 65536, 0),
    "page of ones": _overwritten(0.7, 4096, 0xFF),
    "16 bytes of noise": _overwritten(0.45, 16),
    "page of noise": _overwritten(0.45, 4096),
    "64 KiB of noise": _overwritten(0.45, 65536),
    "last page zeroed": lambda content, _: content[:-4096] + bytes(4096),
    "end of noise": lambda content, rng: content[:-2048] + rng.bytes(2048),
    "16 bytes of each 64 KiB": _repeated(65536, 16),
    "page of each 256 KiB": _repeated(262144, 4096),
    "1 byte missing": _removed(0.5, 1),
    "100 bytes missing": _removed(0.5, 100),
    "page missing": _removed(0.5, 4096),
    "1 byte inserted": _inserted(0.5, 1),
    "page inserted": _inserted(0.5, 4096),
    "page twice": lambda content, _: (
        content[: _at(content, 0.5)] + content[_at(content, 0.5) - 4096 :]
    ),
    "two pages exchanged": _moved,
    "noise before": lambda content, rng: rng.bytes(5000) + content,
    "noise behind": lambda content, rng: content + rng.bytes(5000),
    "line ends changed": lambda content, _: content.replace(b"\n", b"\r\n"),
    "pointer 0": _wrong_pointer(0),
    "pointer 8": _wrong_pointer(8),
    "pointer into the data": _wrong_pointer(5000),
    "pointer beyond the end": _wrong_pointer(10**9),
    "bit of the pointer": _footer_bit,
}


@cache
def recorded(n_messages: int = _N_MESSAGES, size: int | None = None) -> list[Message]:
    """Messages that no two are alike, in ROS 2's CDR; size: of all, else 40 to 900 letters."""
    rng, found = np.random.default_rng(3), []
    for number in range(n_messages):
        letters = rng.integers(97, 123, size or int(rng.integers(40, 900)), dtype=np.uint8)
        text = b"%06d %s\0" % (number, letters.tobytes())
        data = b"\0\1\0\0" + struct.pack("<I", len(text)) + text
        data += bytes(-len(data) % 4)
        found.append((_TOPICS[number % 4], _START_NS + number * _PERIOD_NS, data))
    return found


def _mcap(compression: CompressionType, *, chunked: bool = True) -> Writing:
    def write(folder: Path, messages: list[Message]) -> Path:
        stream = BytesIO()
        writer = McapFileWriter(
            stream, compression=compression, chunk_size=_CHUNK, use_chunking=chunked
        )
        writer.start("ros2")
        definition = message_type(_TYPE).text.encode()
        schema = writer.register_schema(_TYPE, "ros2msg", definition)
        channels = {name: writer.register_channel(name, "cdr", schema) for name in _TOPICS}
        for topic, time_ns, data in messages:
            writer.add_message(channels[topic], time_ns, data, time_ns)
        writer.finish()
        (folder / "bag").mkdir()
        (folder / "bag" / "bag.mcap").write_bytes(stream.getvalue())
        n = len(messages)
        counted = [(Topic(name, message_type(_TYPE)).channel, n // 4) for name in _TOPICS]
        span = FileSpan("bag.mcap", n, _START_NS, messages[-1][1])
        text = yaml_text({ROOT_KEY: bag_metadata([span], counted)})
        (folder / "bag" / FILE_NAME).write_text(text)
        return folder / "bag" / "bag.mcap"

    return write


def _db3(folder: Path, messages: list[Message]) -> Path:
    storage = rosbag2.StoragePlugin.SQLITE3
    with rosbag2.Writer(folder / "bag", version=9, storage_plugin=storage) as writer:
        topics = {name: writer.add_connection(name, _TYPE, typestore=_types()) for name in _TOPICS}
        for topic, time_ns, data in messages:
            writer.write(topics[topic], time_ns, data)
    return folder / "bag" / "bag.db3"


def _bag(compression: Ros1Writer.CompressionFormat | None) -> Writing:
    def write(folder: Path, messages: list[Message]) -> Path:
        store, file = get_typestore(Stores.ROS1_NOETIC), rosbag1.Writer(folder / "bag.bag")
        if compression is not None:
            file.set_compression(compression)
        file.chunk_threshold = _CHUNK
        with file as writer:
            topics = {name: writer.add_connection(name, _TYPE, typestore=store) for name in _TOPICS}
            for topic, time_ns, data in messages:
                writer.write(topics[topic], time_ns, _of_ros1(data))
        return folder / "bag.bag"

    return write


def _of_ros1(data: bytes) -> bytes:
    return bytes(_types().cdr_to_ros1(data, _TYPE))


@cache
def _types() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


FORMATS = {
    "MCAP": _mcap(CompressionType.NONE),
    "MCAP zstd": _mcap(CompressionType.ZSTD),
    "MCAP lz4": _mcap(CompressionType.LZ4),
    "MCAP without chunks": _mcap(CompressionType.NONE, chunked=False),
    "sqlite3": _db3,
    "ROS 1": _bag(None),
    "ROS 1 bz2": _bag(Ros1Writer.CompressionFormat.BZ2),
}


def _plain(file: Path) -> Iterator[Message]:
    if file.suffix == ".mcap":
        with file.open("rb") as stream:
            for _, channel, message in NonSeekingReader(stream).iter_messages(log_time_order=False):
                yield channel.topic, message.log_time, message.data
    elif file.suffix == ".db3":
        with closing(sqlite3.connect(file)) as database:
            names = dict(database.execute("SELECT id, name FROM topics"))
            rows = database.execute("SELECT topic_id, timestamp, data FROM messages")
            yield from ((names[number], time_ns, data) for number, time_ns, data in rows)
    else:
        yield from _ros1_walk(file.read_bytes()[13:], {})


def _ros1_walk(content: bytes, topics: dict[bytes, str]) -> Iterator[Message]:
    """A record is a header of named fields and data, each behind its length."""
    at = 0
    while at + 4 <= len(content):
        (size,) = struct.unpack_from("<I", content, at)
        head, at, fields = content[at + 4 : at + 4 + size], at + 4 + size, {}
        (data_size,) = struct.unpack_from("<I", content, at)
        data, at = content[at + 4 : at + 4 + data_size], at + 4 + data_size
        while head:
            (size,) = struct.unpack_from("<I", head)
            name, _, value = head[4 : 4 + size].partition(b"=")
            fields[name], head = value, head[4 + size :]
        if fields[b"op"] == b"\x05" and fields[b"compression"] == b"none":
            yield from _ros1_walk(data, topics)
        elif fields[b"op"] == b"\x07":
            topics[fields[b"conn"]] = fields[b"topic"].decode()
        elif fields[b"op"] == b"\x02":
            second, ns = struct.unpack("<II", fields[b"time"])
            yield topics[fields[b"conn"]], second * 10**9 + ns, data


def _rosbags(file: Path) -> Iterator[Message]:
    reader = rosbag1.Reader(file) if file.suffix == _ROS1 else rosbag2.Reader(file.parent)
    with reader as opened:
        for connection, time_ns, data in opened.messages():
            yield connection.topic, time_ns, bytes(data)


def _ours(file: Path) -> tuple[set[Message], set[Message]]:
    """What `rescue` saves, and what it marks as doubtful."""
    saved: tuple[set[Message], set[Message]] = set(), set()
    with tempfile.TemporaryDirectory() as folder, suppress(BagError):
        topics = rescue(file, Path(folder) / "saved").topics
        marked = {
            (topic.name, number)
            for topic in topics
            for first, last in topic.doubtful
            for number in range(first, last + 1)
        }
        counts: Counter[str] = Counter()
        for record in BagReader(Path(folder) / "saved").records():
            topic = record.channel.topic
            found = saved[(topic, counts[topic]) in marked]
            found.add((topic, record.log_time_ns, record.data))
            counts[topic] += 1
    return saved


def _saved(read: Callable[[Path], Iterator[Message]], file: Path) -> set[Message]:
    """What a reader gives until it fails, with any error that foreign bytes raise in it."""
    found: set[Message] = set()
    with suppress(Exception):
        found.update(read(file))
    return found


def run() -> None:
    """Measure in a temporary folder; the table is saved.csv in lab/results/broken-bags."""
    rows = [row for kind in KINDS for row in rows_of(kind)]
    save("broken_bags", "Messages saved of broken recordings", rows)
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([rows[0].keys(), *map(dict.values, rows)])
    atomic_write_text(RESULTS / "broken-bags" / "saved.csv", text.getvalue())


def rows_of(kind: str) -> list[dict[str, object]]:
    """A row per format: messages of it that were saved, and the wrong ones."""
    rows: list[dict[str, object]] = []
    for name in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            source = FORMATS[name](Path(folder), recorded())
            truth = set(recorded())
            if source.suffix == _ROS1:
                truth = {(topic, time_ns, _of_ros1(data)) for topic, time_ns, data in truth}
            content = source.read_bytes()
            source.write_bytes(KINDS[kind](content, np.random.default_rng(7)))
            vouched, doubtful = _ours(source)
            row: dict[str, object] = {
                "damage": kind,
                "format": name,
                "recorded": len(truth),
                "serd-bag": len(truth & (vouched | doubtful)),
                "wrong and not marked": len(vouched - truth),
                "wrong and marked": len(doubtful - truth),
            }
            for reader, read in (("plain", _plain), ("rosbags", _rosbags)):
                found = _saved(read, source)
                row[reader] = len(truth & found)
                row[f"{reader}: wrong"] = len(found - truth)
            rows.append(row)
    return rows
