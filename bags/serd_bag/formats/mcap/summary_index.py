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
from heapq import merge
from itertools import pairwise
from struct import Struct
from struct import error as struct_error

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex

from serd_bag.errors import BagError
from serd_bag.formats.mcap.chunks import ENTRY_SIZE, INDEX_HEAD_SIZE, ChunkHead
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

    def contents(self, begin: int, end: int) -> "IndexedContents | None":
        """Return the messages that the entries list in the data from `begin` to `end`.

        Returns None if entries contradict each other, or if no entry lists a part of the data.
        """
        found = IndexedContents()
        copied = sorted((each.offset, each.offset + each.length) for each in self.copied)
        try:
            chunks = map(found.add, map(self.chunk, range(len(self.starts))))
            for start, stop in merge(copied, chunks):
                if start != begin:
                    return None
                begin = stop
        except BagError:
            return None
        return found if begin == end else None

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
    return ChunkIndex(
        chunk_start_offset=start,
        chunk_length=length,
        compression=content[at - name_size : at].decode("ascii", errors="replace"),
        compressed_size=packed_size,
        uncompressed_size=unpacked_size,
        message_start_time=first_ns,
        message_end_time=last_ns,
        message_index_length=index_length,
        message_index_offsets=places,
    )


class IndexedContents:
    """The messages that entries of chunks list.

    counts: by channel, since the size of a message index states how many it lists; first_ns,
    last_ns: log times, None without messages.
    """

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.first_ns: int | None = None
        self.last_ns: int | None = None

    def add(self, chunk: ChunkIndex) -> tuple[int, int]:
        """Count the messages of a chunk; returns begin and end of the chunk with its indexes.

        Raises BagError if the entry contradicts itself or does not list all messages.
        """
        begin = chunk.chunk_start_offset
        end = begin + chunk.chunk_length + chunk.message_index_length
        indexes = sorted((place, channel) for channel, place in chunk.message_index_offsets.items())
        edges = [*(place for place, _ in indexes), end]
        is_counted = bool(indexes) or not chunk.message_end_time
        if edges[0] != begin + chunk.chunk_length or not is_counted:
            raise BagError("the message indexes of a chunk do not follow it")
        sizes = [following - place - _MESSAGE_INDEX_HEAD for place, following in pairwise(edges)]
        if any(size < 0 or size % ENTRY_SIZE for size in sizes):
            raise BagError("the size of a message index is not one of whole entries")
        for (_, channel), size in zip(indexes, sizes, strict=True):
            self.counts[channel] += size // ENTRY_SIZE
        if indexes:
            first_ns, last_ns = chunk.message_start_time, chunk.message_end_time
            self.first_ns = first_ns if self.first_ns is None else min(self.first_ns, first_ns)
            self.last_ns = last_ns if self.last_ns is None else max(self.last_ns, last_ns)
        return begin, end
