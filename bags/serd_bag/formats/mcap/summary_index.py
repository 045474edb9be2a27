"""The index in the summary of an MCAP file: where chunks, attachments and metadata records stand.

An entry is relied on only after it was compared: with the other entries and the statistics, as
`counts` allows, or with what stands at the place that it names.
"""

from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import astuple
from functools import cached_property
from itertools import pairwise
from struct import Struct
from struct import error as struct_error

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex

from serd_bag.errors import BagError
from serd_bag.formats.mcap.chunks import ChunkHead
from serd_bag.formats.mcap.records import RECORD_HEAD, CopiedIndex, read_record

#: Opcodes of the records that are entries.
ENTRIES = (int(Opcode.CHUNK_INDEX), int(Opcode.ATTACHMENT_INDEX), int(Opcode.METADATA_INDEX))
MOST_COPIED = 100_000
#: first and last log time, start and length of the chunk, size of the places of message indexes
_CHUNK_FIELDS = Struct("<QQQQI")
#: channel, place of its message index
_PLACE = Struct("<HQ")
#: length of the message indexes, length of the compression's name; packed and unpacked size
_LENGTHS, _SIZES = Struct("<QI"), Struct("<QQ")
#: Of a message index, channel and size of the entries; each entry, log time and offset.
INDEX_HEAD_SIZE, ENTRY_SIZE = 6, 16
_MESSAGE_INDEX_HEAD = RECORD_HEAD.size + INDEX_HEAD_SIZE


class SummaryIndex:
    """The entries of one summary.

    Entries of chunks, of which there may be many, stay packed until one is asked for. copied:
    entries of attachments and metadata records.
    """

    def __init__(self, summary: bytes = b"") -> None:
        self.copied: list[CopiedIndex] = []
        self._summary = summary
        #: start of the chunk, its length, begin and end of the entry in the summary
        self._chunks = array("Q")

    def add(self, opcode: int, begin: int, end: int) -> None:
        """Add the entry between two places of the summary; raises BagError if it is damaged."""
        content = self._summary[begin:end]
        if opcode == Opcode.ATTACHMENT_INDEX and len(self.copied) < MOST_COPIED:
            self.copied.append(read_record(AttachmentIndex, content))
        elif opcode == Opcode.METADATA_INDEX and len(self.copied) < MOST_COPIED:
            self.copied.append(read_record(MetadataIndex, content))
        elif opcode == Opcode.CHUNK_INDEX:
            entry = _chunk_index(content)
            self._chunks.extend((entry.chunk_start_offset, entry.chunk_length, begin, end))

    @cached_property
    def starts(self) -> "array[int]":
        """Starts of the chunks, sorted."""
        return array("Q", self._sorted[:, 0].tobytes())

    def length(self, number: int) -> int:
        """Bytes of the chunk whose start has this number."""
        return int(self._sorted[number, 1])

    def chunk(self, number: int) -> ChunkIndex:
        """The entry of the chunk whose start has this number."""
        begin, end = self._sorted[number, 2:].tolist()
        return _chunk_index(self._summary[begin:end])

    @cached_property
    def _sorted(self) -> "np.ndarray[tuple[int, int], np.dtype[np.uint64]]":
        rows = np.frombuffer(self._chunks, np.uint64).reshape(-1, 4)
        return rows[np.argsort(rows[:, 0], kind="stable")]

    def contents(self, begin: int, end: int) -> tuple[Counter[int], int, int] | None:
        """Messages that the entries list in the data from `begin` to `end`.

        Returns their number by channel, and their first and last log time (ns), 0 without messages.
        Returns None if an entry contradicts itself or another one, or if no entry lists a part of
        the data. The size of a message index states how many messages it lists.
        """
        copied = {each.offset: each.length for each in self.copied}
        counts: Counter[int] = Counter()
        first_ns, last_ns = [], []
        for number in range(len(self.starts)):
            chunk = self.chunk(number)
            while begin in copied:
                begin += copied.pop(begin)
            listed = _listed_messages(chunk)
            if begin != chunk.chunk_start_offset or listed is None:
                return None
            begin += chunk.chunk_length + chunk.message_index_length
            counts.update(listed)
            if listed:
                first_ns.append(chunk.message_start_time)
                last_ns.append(chunk.message_end_time)
        while begin in copied:
            begin += copied.pop(begin)
        if begin != end or copied:
            return None
        return counts, min(first_ns, default=0), max(last_ns, default=0)

    def fault_of_chunk(self, found: ChunkIndex) -> str:
        """Return how the entry of a chunk is wrong, and an empty text if it is right.

        found: the entry that the chunk should have. A summary without entries of chunks is right.
        """
        number = bisect_left(self.starts, found.chunk_start_offset)
        if self.starts[number : number + 1] != array("Q", [found.chunk_start_offset]):
            return "the summary does not list a chunk" if self.starts else ""
        if self.chunk(number) == found:
            return ""
        return "the summary lists a chunk with places or sizes that it has not"

    def faults_of_copied(self, found: Iterable[CopiedIndex]) -> Iterator[str]:
        """Describe wrong entries of attachments and of metadata records.

        found: the entries that they should have. A summary without entries of a kind is right.
        """
        for kind, name in ((AttachmentIndex, "attachments"), (MetadataIndex, "metadata records")):
            listed, there = (
                Counter(astuple(each) for each in some if isinstance(each, kind))
                for some in (self.copied, found)
            )
            if listed and listed != there:
                yield f"the summary lists {name} with places or sizes that they have not"


def entry_of_chunk(head: ChunkHead, start: int, length: int) -> ChunkIndex:
    """The entry that a chunk should have, as yet without message indexes."""
    return ChunkIndex(
        chunk_start_offset=start,
        chunk_length=length,
        compression=head.compression,
        compressed_size=head.data_size,
        uncompressed_size=head.size,
        message_start_time=head.first_ns,
        message_end_time=head.last_ns,
        message_index_length=0,
        message_index_offsets={},
    )


def _chunk_index(content: bytes) -> ChunkIndex:
    """Read an entry of a chunk in a fifth of the time of `read_record`; BagError if damaged."""
    try:
        first_ns, last_ns, start, length, size = _CHUNK_FIELDS.unpack_from(content)
        at = _CHUNK_FIELDS.size + size
        places = dict(_PLACE.iter_unpack(content[_CHUNK_FIELDS.size : at]))
        index_length, name_size = _LENGTHS.unpack_from(content, at)
        at += _LENGTHS.size + name_size
        packed_size, unpacked_size = _SIZES.unpack_from(content, at)
    except struct_error:
        raise BagError("a chunkindex record is damaged") from None
    name = content[at - name_size : at].decode("ascii", errors="replace")
    head = ChunkHead(first_ns, last_ns, unpacked_size, 0, name, 0, packed_size)
    entry = entry_of_chunk(head, start, length)
    entry.message_index_offsets, entry.message_index_length = places, index_length
    return entry


def _listed_messages(chunk: ChunkIndex) -> dict[int, int] | None:
    """Messages by channel, by the sizes of the message indexes that should follow the chunk.

    Returns None if they cannot follow each other there, or do not list all messages.
    """
    begin = chunk.chunk_start_offset + chunk.chunk_length
    indexes = sorted((place, channel) for channel, place in chunk.message_index_offsets.items())
    edges = [*(place for place, _ in indexes), begin + chunk.message_index_length]
    sizes = [following - place - _MESSAGE_INDEX_HEAD for place, following in pairwise(edges)]
    is_counted = bool(indexes) or not chunk.message_end_time
    if edges[0] != begin or not is_counted or any(n < 0 or n % ENTRY_SIZE for n in sizes):
        return None
    return {channel: n // ENTRY_SIZE for (_, channel), n in zip(indexes, sizes, strict=True)}
