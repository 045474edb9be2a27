"""`fix-clock`: stamps of senders whose clocks are wrong, by the clock of the log times."""

import csv
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from serd_bag.command.rewrite import RewriteReport, copy
from serd_bag.errors import BagError
from serd_bag.health.check import check_bag, wrong_clocks
from serd_bag.messages.clocks import ClockDifference
from serd_bag.messages.stamps import StampFinder
from serd_bag.reader import BagReader
from serd_bag.topic import Channel, Record, topic_of
from serd_bag.writer import BagWriter, new_folder

_SECOND_NS = 1_000_000_000
#: That a stamp can state.
_LATEST_NS = (2**31 - 1) * _SECOND_NS
#: In the folder of the new bag.
ORIGINALS = "original_stamps.csv"
_COLUMNS = ("topic", "sender", "message", "byte", "original_ns", "corrected_ns")


@dataclass(frozen=True)
class ClockReport(RewriteReport):
    """The result of `fix_clock`: senders whose stamps were corrected, as pairs with the topic."""

    senders: tuple[tuple[str, str], ...] = ()
    n_corrected: int = 0


def fix_clock(source: str | Path, target: str | Path) -> ClockReport:
    """Write a bag with the stamps that clocks which are right would have given; `source` stays.

        report = fix_clock("drive", "drive_fixed")

    Of each sender whose clock `check_bag` finds wrong, the stamps are moved by how far its clock
    was ahead when the message was received; all other bytes stay as they are. The stamps as they
    were are in `original_stamps.csv` of the new bag: message counts from 0 within the topic, byte
    is the first one of the stamp. Where no clock is wrong, nothing is written. BagError where the
    bag is damaged, and where there is something to write and `target` is neither new nor empty.
    """
    found = check_bag(source, most_compared=sys.maxsize)
    if not found.sound:
        raise BagError(f"{found.faults[0]}; save what it holds with 'serd-bag rescue'")
    wrong = wrong_clocks(found.topics)
    target = Path(target).resolve()
    if not wrong:
        return ClockReport(found.path, target, {}, ())
    reader = BagReader(source)
    with (
        new_folder(target) as folder,
        BagWriter(folder, profile=reader.profile) as writer,
        (folder / ORIGINALS).open("w", encoding="utf-8", newline="") as file,
    ):
        correction = _Correction(wrong, csv.writer(file))
        copy(reader, writer, reader.channels, correction)
    damage = tuple(each.sentence() for each in reader.damage)
    return ClockReport(
        *(found.path, target, dict(writer.counts), damage, tuple(wrong), correction.n_corrected)
    )


class _Correction:
    """Corrects the stamps of one record after the other, and lists them as they were."""

    def __init__(self, wrong: dict[tuple[str, str], ClockDifference], rows: Any) -> None:
        self.n_corrected = 0
        self._wrong, self._rows = wrong, rows
        rows.writerow(_COLUMNS)
        self._topics = {topic for topic, _ in wrong}
        self._finders: dict[Channel, StampFinder] = {}
        self._numbers: Counter[str] = Counter()

    def __call__(self, record: Record) -> Record:
        channel, topic, data = record.channel, record.channel.topic, record.data
        if topic not in self._topics:
            return record
        if channel not in self._finders:
            self._finders[channel] = StampFinder(topic_of(channel), inner=True)
        finder = self._finders[channel]
        log_s = np.array([record.log_time_ns / _SECOND_NS])
        for stamp in finder(data):
            clocks = self._wrong.get((topic, stamp.sender))
            if clocks is None or stamp.time_ns <= 0:
                continue
            ahead_ns = round(float(clocks.ahead_s(log_s)[0]) * _SECOND_NS)
            if not ahead_ns:
                continue
            corrected_ns = min(max(0, stamp.time_ns - ahead_ns), _LATEST_NS)
            data = finder.moved(data, stamp, corrected_ns)
            values = (topic, stamp.sender, self._numbers[topic], stamp.place)
            self._rows.writerow((*values, stamp.time_ns, corrected_ns))
            self.n_corrected += 1
        self._numbers[topic] += 1
        return record._replace(data=data)
