"""Rows of a damaged SQLite file, page by page, without the tree that should lead to them.

Each page of a table's rows (a leaf, kind 13) lists where its rows are; a row too long for its page
continues in a chain of overflow pages. https://sqlite.org/fileformat2.html, sections 1.6, 2.
"""

import re
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain as chain_of
from itertools import islice
from mmap import mmap

from serd_bag.damage import State
from serd_bag.formats.limits import LARGEST_CONTENT, most_records

Value = int | float | str | bytes | None

_FILE_HEAD = 100
_TABLE_LEAF = 13
#: Inner pages, and those of indexes.
_OTHER_KINDS = (2, 5, 10)
_USUAL_PAGE_SIZE = 4096
_MAGIC = b"SQLite format 3\0"
#: A page of rows: kind, no or one free block, 1 to 511 rows, place of the first, few free bytes.
_LEAF = re.compile(rb"\r[\0-\x0f].(?:\0[\x01-\xff]|\x01.)[\0-\x0f].[\0-\x3c]", re.DOTALL)
#: Rows by which pages are numbered, and how far before or behind a row its overflow may begin.
_MOST_TRIED, _MOST_PAGES, _NEAR = 50, 20_000, 12
_INTEGER_SIZES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}


class SqlitePages:
    """The pages of one file; `n_cut` counts rows whose end is missing, once they were read."""

    def __init__(self, content: bytes | mmap) -> None:
        self._content = content
        self._page_size = _page_size(content)
        self._usable = self._page_size - int.from_bytes(content[20:21], "big")
        #: where page 1 begins, or would; whether the other pages have numbers
        self._begin, self._is_numbered = 0, True
        if content[: len(_MAGIC)] != _MAGIC:
            self._usable = self._page_size
            self._find_beginning()
        self._last = (len(content) - self._begin) // self._page_size + 1
        self._free = self._free_pages()
        self.n_cut = 0
        #: of each page: 0 not used, 1 used, 2 with rows that are cut off
        self._states = bytearray(self._last + 1)
        self._n_rows = most_records(len(content))
        self._n_bytes = 4 * len(content) + LARGEST_CONTENT

    def rows(self) -> Iterator[tuple[int, tuple[Value, ...]]]:
        """(row number, values) of every readable row of any table, in the order of the file."""
        for number in range(1, self._last + 1):
            if self._n_rows <= 0:
                return
            if number not in self._free:
                yield from self._rows_of(number)

    def _rows_of(self, number: int) -> Iterator[tuple[int, tuple[Value, ...]]]:
        page = self._page(number)
        head = _FILE_HEAD if number == 1 else 0
        if len(page) < head + 8 or page[head] != _TABLE_LEAF:
            self._states[number] |= len(page) > head and page[head] in _OTHER_KINDS
            return
        self._states[number] |= 1
        (n_cells,) = struct.unpack_from(">H", page, head + 3)
        for index in range(min(n_cells, (len(page) - head - 8) // 2)):
            self._n_rows -= 1
            (start,) = struct.unpack_from(">H", page, head + 8 + 2 * index)
            try:
                row = self._row(page, start)
            except (IndexError, ValueError, struct.error):
                self.n_cut += 1
                self._states[number] |= 2
                continue
            yield row

    def lost(self) -> Iterator[tuple[int, int, State, str]]:
        """Yield begin, end, state and reason of all pages that were not read, or not wholly."""
        if self._begin > 0:
            yield 0, self._begin, "lost", "no page of a database begins here"
        for number in range(1, len(self._states)):
            state = self._states[number]
            start = max(0, self._place(number))
            if state & 2:
                yield start, start + self._page_size, "partly read", "rows of a page are cut off"
            elif not state and number not in self._free:
                yield start, start + self._page_size, "lost", "no page of a database begins here"

    def _row(self, page: bytes, start: int) -> tuple[int, tuple[Value, ...]]:
        size, at = _varint(page, start)
        row_number, at = _varint(page, at)
        return row_number, _values(self._payload(page, at, size))

    def _payload(self, page: bytes, at: int, size: int) -> bytes:
        """The bytes of a row; ValueError where a part is missing."""
        self._n_bytes -= size
        if size > min(len(self._content), LARGEST_CONTENT) or self._n_bytes < 0:
            raise ValueError("longer than the file")
        here = self._size_on_page(size)
        if here < size and not self._is_numbered:
            raise ValueError("its further pages cannot be told")
        parts, rest = [page[at : at + here]], size - here
        following = struct.unpack_from(">I", page, at + here)[0] if rest else 0
        while rest > 0:
            part = self._page(following) if following else b""
            self._states[following if part else 0] |= 1
            (following,) = struct.unpack_from(">I", part)
            parts.append(part[4 : self._usable][:rest])
            rest -= self._usable - 4
        payload = b"".join(parts)
        if len(payload) != size:
            raise ValueError("cut")
        return payload

    def _size_on_page(self, size: int) -> int:
        if size <= self._usable - 35:
            return size
        least = (self._usable - 12) * 32 // 255 - 23
        wanted = least + (size - least) % (self._usable - 4)
        return wanted if wanted <= self._usable - 35 else least

    def _page(self, number: int) -> bytes:
        start = self._place(number)
        return self._content[start : start + self._page_size] if start >= 0 else b""

    def _place(self, number: int) -> int:
        return self._begin + (number - 1) * self._page_size

    def _find_beginning(self) -> None:
        """Find where page 1 would begin in bytes without the head of their database.

        Pages begin where most of them do that hold rows. Their numbers are those by which most rows
        find their overflow pages; where others would do as well, rows that have some are not read.
        """
        size = self._page_size
        leaves = [found.start() for found in _LEAF.finditer(self._content)]
        if not leaves:
            return
        ((phase, _),) = Counter(place % size for place in leaves).most_common(1)
        found = (self._chains(place) for place in leaves if place % size == phase)
        chains: list[tuple[int, int, int]] = []
        for chain in islice(chain_of.from_iterable(found), _MOST_TRIED):
            if len(chains) < 2 or sum(n_pages for *_, n_pages in chains) < _MOST_PAGES:
                chains.append(chain)
        near = Counter(
            place - size * (number - 1 + step)
            for place, number, _ in chains
            for step in range(-_NEAR, _NEAR + 1)
        )
        tried = [phase, *(begin for begin, _ in near.most_common(_MOST_TRIED))]
        ends = {begin: sum(self._ends(begin, *chain[1:]) for chain in chains) for begin in tried}
        most = max(ends.values())
        best = [begin for begin in ends if ends[begin] == most]
        self._begin = 0 if 0 in best else best[0]
        self._is_numbered = len(best) == 1 or self._begin == 0

    def _chains(self, place: int) -> Iterator[tuple[int, int, int]]:
        """Place of a page, first overflow page and number of them of each long row on it."""
        page = self._content[place : place + self._page_size]
        (n_cells,) = struct.unpack_from(">H", page, 3)
        with suppress(IndexError, struct.error):
            for index in range(n_cells):
                (start,) = struct.unpack_from(">H", page, 8 + 2 * index)
                size, at = _varint(page, start)
                at = _varint(page, at)[1] + self._size_on_page(size)
                rest = size - self._size_on_page(size)
                if rest:
                    yield (
                        place,
                        struct.unpack_from(">I", page, at)[0],
                        -(-rest // (self._usable - 4)),
                    )

    def _ends(self, begin: int, number: int, n_pages: int) -> bool:
        """Whether a chain of so many overflow pages ends where it should."""
        for _ in range(n_pages):
            start = begin + (number - 1) * self._page_size
            if number < 1 or not 0 <= start <= len(self._content) - 4:
                return False
            (number,) = struct.unpack_from(">I", self._content, start)
        return number == 0

    def _free_pages(self) -> set[int]:
        """Pages the file lists as unused, which may hold rows that were deleted.

        Empty where they are not as many as it counts: the list may then lead to pages in use.
        """
        found: set[int] = set()
        trunk = int.from_bytes(self._content[32:36], "big")
        while trunk and trunk not in found:
            found.add(trunk)
            page = self._page(trunk)
            if len(page) < self._page_size:
                break
            following, n_leaves = struct.unpack_from(">II", page)
            n_leaves = min(n_leaves, self._page_size // 4 - 2)
            found.update(struct.unpack_from(f">{n_leaves}I", page, 8))
            trunk = following
        return found if len(found) == int.from_bytes(self._content[36:40], "big") else set()


def database_size(head: bytes, otherwise: int) -> int:
    """Bytes of a database by its head; `otherwise` where that does not state it."""
    n_pages = int.from_bytes(head[28:32], "big")
    is_valid = head[24:28] == head[92:96] and n_pages > 0
    return n_pages * _page_size(head) if is_valid else otherwise


def has_rows(content: bytes | mmap, start: int, end: int) -> bool:
    """Whether a page with rows of messages stands between two places."""
    if not _LEAF.search(content, start, end):
        return False
    rows = SqlitePages(content[start:end]).rows()
    return any(len(row) == 4 and isinstance(row[3], bytes) for _, row in rows)


def _page_size(content: bytes | mmap) -> int:
    size = int.from_bytes(content[16:18], "big")
    size = 65536 if size == 1 else size
    return size if size >= 512 and size & (size - 1) == 0 else _USUAL_PAGE_SIZE


def _varint(content: bytes, at: int) -> tuple[int, int]:
    """(number, where it ends)."""
    value = 0
    for place in range(at, at + 8):
        value = value << 7 | content[place] & 0x7F
        if not content[place] & 0x80:
            return value, place + 1
    return value << 8 | content[at + 8], at + 9


def _values(payload: bytes) -> tuple[Value, ...]:
    head_size, at = _varint(payload, 0)
    kinds = []
    while at < head_size:
        kind, at = _varint(payload, at)
        kinds.append(kind)
    values = []
    for kind in kinds:
        value, at = _value(payload, at, kind)
        values.append(value)
    if at != len(payload):
        raise ValueError("a row is longer than its values")
    return tuple(values)


def _value(payload: bytes, at: int, kind: int) -> tuple[Value, int]:
    """(value, where it ends); ValueError for kinds no row has."""
    if kind in _INTEGER_SIZES:
        end = at + _INTEGER_SIZES[kind]
        return int.from_bytes(payload[at:end], "big", signed=True), end
    if kind == 7:
        return float(struct.unpack_from(">d", payload, at)[0]), at + 8
    if kind in (0, 8, 9):
        return (None if kind == 0 else kind - 8), at
    if kind < 12:
        raise ValueError(f"no value is of kind {kind}")
    end = at + (kind - 12) // 2
    content = payload[at:end]
    return content.decode("utf-8", errors="replace") if kind % 2 else content, end
