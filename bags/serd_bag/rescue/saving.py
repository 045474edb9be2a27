"""`rescue`: every whole message of a recording, as it is, in a new bag, with a certificate."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from serd_bag.damage import FileScan, Span
from serd_bag.errors import BagError
from serd_bag.files import atomic_write_text
from serd_bag.formats.limits import yaml_values
from serd_bag.reader import BagReader
from serd_bag.rescue.certificate import Certificate, FileBytes, TopicSaved, runs
from serd_bag.writer import ROS2_RECORD, BagWriter, new_folder

CERTIFICATE, PAGE = "certificate.json", "certificate.html"
#: Name of the MCAP metadata record that lists doubtful messages.
MARK = "serd_bag_rescue"
_SECOND_NS = 1_000_000_000


@dataclass
class _Saved:
    """What was saved of one topic; n_places: damaged places before its last message."""

    n: int = 0
    doubtful: list[int] = field(default_factory=list)
    per_second: Counter[int] = field(default_factory=Counter)
    seconds_lost: float = 0.0
    last_ns: int | None = None
    n_places: int = 0

    def add(self, log_time_ns: int, n_places: int, *, is_doubtful: bool) -> None:
        """Count a message that comes after so many damaged places."""
        if is_doubtful:
            self.doubtful.append(self.n)
        self.n += 1
        self.per_second[log_time_ns // _SECOND_NS] += 1
        if self.last_ns is not None and n_places > self.n_places:
            self.seconds_lost += max(0, log_time_ns - self.last_ns) / _SECOND_NS
        self.last_ns, self.n_places = log_time_ns, n_places


def rescue(source: str | Path, target: str | Path, *, doubtful: bool = True) -> Certificate:
    """Save every whole message of a recording, or of any bytes that hold some, as a new bag.

        certificate = rescue("drive.mcap", "drive_rescued")
        print(certificate.n_messages, certificate.least_lost, certificate.most_lost)

    source: a bag, a storage file, any other file or a folder of files; it stays as it is. Messages
    are copied as they are, whatever their encoding: those of ROS 1 stay messages of ROS 1. Each
    recording that is found in other bytes becomes a file of the new bag. doubtful: save also what
    a damaged part seems to hold; such messages are listed in the certificate and in the bag, in the
    metadata record `serd_bag_rescue`. The bag folder has the certificate as JSON and as a page.
    Raises BagError where `target` is neither new nor empty and where there is no source.
    """
    reader = BagReader(source, tolerant=True, thorough=True, carve=True)
    saved: defaultdict[str, _Saved] = defaultdict(_Saved)
    with new_folder(Path(target)) as folder:
        with BagWriter(folder, profile=reader.profile) as writer:
            for channel in reader.channels:
                writer.add_channel(channel)
            _copy(reader, writer, saved, doubtful=doubtful)
            writer.kept = kept_metadata(reader)
            marks = {name: runs(each.doubtful) for name, each in saved.items() if each.doubtful}
            if marks:
                writer.add_metadata(MARK, {"doubtful": json.dumps(marks, ensure_ascii=False)})
        found = _certificate(reader, Path(target).resolve(), saved)
        text = json.dumps(found.values(), indent=1, ensure_ascii=False, default=str)
        atomic_write_text(folder / CERTIFICATE, f"{text}\n")
        atomic_write_text(folder / PAGE, found.page())
    return found


def _copy(
    reader: BagReader, writer: BagWriter, saved: defaultdict[str, _Saved], *, doubtful: bool
) -> None:
    """Copy all records; each further recording of a file begins a new file."""
    n_places = 0
    for scan, records in reader.walks(doubtful=doubtful):
        if scan.start and writer.n_messages:
            writer.start_file(scan.profile)
        for record in records:
            saved[record.channel.topic].add(
                record.log_time_ns, n_places + len(scan.marks), is_doubtful=scan.is_doubtful
            )
            writer.write_record(record)
        writer.copy_records(scan)
        n_places += len(scan.marks)


def kept_metadata(reader: BagReader) -> dict[str, Any]:
    """Values of metadata.yaml, or of what rosbag2 has of it in an MCAP file."""
    if reader.layout.metadata is not None:
        return reader.layout.metadata
    found: dict[str, Any] = {}
    for _, scan in reader.scans:
        for name, values in scan.metadata():
            if name == ROS2_RECORD:
                with suppress(BagError):
                    content = yaml_values(values.get("serialized_metadata", ""))
                    found = content if isinstance(content, dict) else found
    return found


def _certificate(reader: BagReader, target: Path, saved: defaultdict[str, _Saved]) -> Certificate:
    scans = [scan for _, scan in reader.scans]
    is_whole = not any(scan.is_cut or scan.marks for scan in scans) and not reader.layout.fault
    last_ns = max((each.last_ns or 0 for each in saved.values()), default=0)
    n_places = sum(len(scan.marks) for scan in scans)
    is_open = all(n_places > each.n_places for each in saved.values())
    listed = reader.layout.messages_by_topic
    topics = []
    for name in sorted({*saved, *listed, *(each.topic for each in reader.channels)}):
        found = saved[name]
        seconds, n_doubtful = found.seconds_lost, len(found.doubtful)
        if found.last_ns is not None and n_places > found.n_places:
            seconds += max(0, last_ns - found.last_ns) / _SECOND_NS
        if listed:
            n_lost, is_known = max(0, listed.get(name, 0) - found.n + n_doubtful), True
        else:
            n_lost, is_known = _lost_of(name, scans)
        least = max(0, n_lost - n_doubtful)
        most = n_lost if is_known or is_whole else None
        topics.append(
            TopicSaved(
                *(name, found.n, n_doubtful, runs(found.doubtful)),
                *(least, most, 0.0 if most == 0 else None if is_open else seconds),
                dict(sorted(found.per_second.items())),
            )
        )
    n_lost, is_known = reader.losses.n_messages, reader.losses.all_known or is_whole
    n_doubtful = sum(topic.n_doubtful for topic in topics)
    return Certificate(
        source=reader.path,
        target=target,
        files=tuple(_files(reader)),
        topics=tuple(topics),
        damage=tuple(each.sentence() for each in reader.damage),
        n_left_out=sum(scan.n_left_out for scan in scans),
        least_lost=max(0, n_lost - n_doubtful),
        most_lost=n_lost if is_known else None,
    )


def _lost_of(topic: str, scans: Sequence[FileScan]) -> tuple[int, bool]:
    """Sound messages of a topic that are missing where files state their number, and whether all
    damaged files do."""
    n_lost, is_known = 0, True
    for scan in scans:
        if scan.expected is None:
            is_known &= not (scan.is_cut or scan.marks)
        else:
            n_lost += max(0, scan.expected_of.get(topic, 0) - scan.counts[topic])
    return n_lost, is_known


def _files(reader: BagReader) -> Iterator[FileBytes]:
    """Each file of the source, whose bytes outside of recordings are not ours."""
    for file, path in zip(reader.layout.files, reader.paths, strict=True):
        spans: list[Span] = []
        place, size = 0, path.stat().st_size
        for _, scan in reader.scans:
            if scan.path == path:
                if scan.start > place:
                    spans.append(Span(place, scan.start, "not ours", "no recording begins here"))
                spans += scan.spans
                place = size if scan.end is None else scan.end
        if place < size:
            spans.append(Span(place, size, "not ours", "no recording begins here"))
        yield FileBytes(file, tuple(spans))
