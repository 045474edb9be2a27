"""Recordings within any bytes: a disk image, a file without its head, several files in one.

A recording begins with the magic bytes of its format and reaches to where its own end says, to the
next one, or to the end of the bytes. Bytes before, between and behind them are a recording without
a head where chunks of MCAP or ROS 1, or pages of SQLite, stand in them.
"""

import mmap
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from serd_bag.errors import BagError, disk_errors
from serd_bag.formats.mcap.chunks import CHUNK_PATTERN, LONGEST_HEAD, chunk_head
from serd_bag.formats.mcap.file_end import ends_with_footer
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.formats.ros1.records import CHUNK_PATTERN as ROS1_CHUNK
from serd_bag.formats.rosbag2.layout import MAGIC, ROS1_SUFFIX
from serd_bag.formats.sqlite.pages import database_size, has_rows

#: Bytes that a recording has at least.
_LEAST = 64
_MCAP = b"\x89MCAP0\r\n"


class Part(NamedTuple):
    """Bytes of a file from `start` to `end` that are a recording: `.mcap`, `.db3` or `.bag`."""

    kind: str
    start: int
    end: int


def recordings_in(path: Path, kind: str = "") -> list[Part]:
    """All recordings in a file, in order; kind: of one without a head, empty if it is not known."""
    with disk_errors("read", path, BagError), path.open("rb") as stream:
        size = path.stat().st_size
        if not size:
            return []
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return list(_parts(content, size, kind))


def _parts(content: mmap.mmap, size: int, headless: str) -> Iterator[Part]:
    starts, ends = [], []
    for magic, kind in MAGIC.items():
        for place in _places(content, magic):
            if kind == ".mcap" and ends_with_footer(content[max(0, place - 256) : place]):
                ends.append(place + len(_MCAP))
            else:
                starts.append((place, kind))
    place = 0
    for (start, kind), (following, _) in pairwise([*sorted(starts), (size, "")]):
        yield from _headless(content, place, start, headless, ends)
        place = following
        if kind == ".mcap":
            place = min([end for end in ends if start < end <= following], default=following)
        elif kind == ".db3":
            place = min(following, start + database_size(content[start : start + 100], following))
        yield Part(kind, start, place)
    yield from _headless(content, place, size, headless, ends)


def _places(content: mmap.mmap, magic: bytes) -> Iterator[int]:
    place = content.find(magic)
    while place >= 0:
        yield place
        place = content.find(magic, place + 1)


def _headless(
    content: mmap.mmap, start: int, end: int, kind: str, mcap_ends: list[int]
) -> Iterator[Part]:
    """The recording without a head that these bytes may be."""
    if end - start < _LEAST:
        return
    if kind and end - start == len(content):
        yield Part(kind, start, end)
    elif any(start < place <= end for place in mcap_ends):
        yield Part(".mcap", start, end)
    elif has_rows(content, start, end):
        yield Part(".db3", start, end)
    elif any(_is_chunk(content, at.start()) for at in CHUNK_PATTERN.finditer(content, start, end)):
        yield Part(".mcap", start, end)
    elif ROS1_CHUNK.search(content, start, end):
        yield Part(ROS1_SUFFIX, start, end)


def _is_chunk(content: mmap.mmap, place: int) -> bool:
    """Whether a chunk of MCAP begins there whose lengths agree."""
    head = content[place : place + LONGEST_HEAD]
    try:
        found = chunk_head(head)
    except BagError:
        return False
    _, length = RECORD_HEAD.unpack_from(head)
    return bool(RECORD_HEAD.size + length == found.data_start + found.data_size)
