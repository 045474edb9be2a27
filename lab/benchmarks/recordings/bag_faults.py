"""What each fault of a recording costs, measured: the table in docs/bags.md.

A recorder of 20 topics at 50 Hz is killed at 20 moments; a finished recording of the same topics is
cut and damaged at many places. Lost are messages that had been handed to the recorder before the
fault, and the time they span. A fault is undetected where messages are missing or differ from those
recorded and the reader reports no damage.

python -m lab bag-faults        # measures for a minute, writes the rows of the table
"""

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE

from lab.benchmarks.report import markdown_row, write_rows
from serd_bag.formats.mcap.records import RECORD_HEAD
from serd_bag.formats.mcap.scan import McapScan
from serd_bag.writer import BagWriter

_DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "bags.md"
_TYPE = "geometry_msgs/msg/PoseStamped"
_N_TOPICS, _RATE_HZ, _DURATION_S = 20, 50, 6.0
_FLUSH_PERIOD_S = 0.25
_N_KILLS, _N_TRIES = 20, 500
_PAGE = 4096
_SEED = 5
_RECORD = f"""
import sys, time
from serd_bag.writer import BagWriter
writer = BagWriter(sys.argv[1], flush_period_s={_FLUSH_PERIOD_S})
for topic in range({_N_TOPICS}):
    writer.add_topic(f"/topic_{{topic}}", "{_TYPE}")
print("recording", flush=True)
while True:
    for topic in range({_N_TOPICS}):
        writer.write(f"/topic_{{topic}}", bytes(96), time.time_ns())
    writer.flush_if_due()
    time.sleep({1 / _RATE_HZ})
"""

#: (topic, log time in ns, data)
Message = tuple[str, int, bytes]


@dataclass(frozen=True)
class Loss:
    """What one fault cost; lost_s: time the lost messages span."""

    n_lost: int
    lost_s: float
    undetected: bool


@dataclass(frozen=True)
class Whole:
    """A finished file; chunks: (first byte, messages up to its end) of each."""

    content: bytes
    messages: tuple[Message, ...]
    chunks: tuple[tuple[int, int], ...]


def run() -> None:
    """Measure every fault and write the document."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kills = _kills(folder)
        whole = _recording(folder)
        unfinished = _unfinished(whole)
        rows = [
            ("SIGKILL of the writing process, random moments", kills),
            ("cut at each record's beginning", _cuts(folder, whole, _starts(whole.content))),
            ("cut in the middle of each record", _cuts(folder, whole, _middles(whole.content))),
            ("one bit flipped, random places", _flips(folder, whole)),
            ("4 KiB page zeroed, random places", _zeroed_pages(folder, whole)),
            ("unfinished, one bit flipped", _flips(folder, unfinished)),
            ("unfinished, 4 KiB page zeroed", _zeroed_pages(folder, unfinished)),
            ("first byte wrong", [_of(folder, whole, b"X" + whole.content[1:])]),
            ("magic number zeroed", [_of(folder, whole, bytes(8) + whole.content[8:])]),
            ("file emptied (0 bytes)", [_of(folder, whole, b"")]),
            ("file overwritten with zeros", [_of(folder, whole, bytes(len(whole.content)))]),
        ]
    write_rows(_DOCUMENT, ["fault"], "".join(_line(name, losses) for name, losses in rows))
    print(f"wrote {_DOCUMENT}")


def _kills(folder: Path) -> list[Loss]:
    rng = np.random.default_rng(_SEED)
    losses = []
    for number in range(_N_KILLS):
        path = folder / f"killed_{number}"
        command = [sys.executable, "-c", _RECORD, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(rng.uniform(0.3, 1.3))
            killed_ns = time.time_ns()
            process.send_signal(signal.SIGKILL)
        found, detected = _read(path / f"{path.name}_0.mcap")
        lost_s = (killed_ns - found[-1][1]) * 1e-9
        losses.append(Loss(round(lost_s * _RATE_HZ) * _N_TOPICS, lost_s, not detected))
    return losses


def _recording(folder: Path) -> Whole:
    """A finished recording of made-up times, in chunks of one flush period."""
    path = folder / "whole"
    now_s = 0.0
    rng = np.random.default_rng(_SEED)
    with BagWriter(path, flush_period_s=_FLUSH_PERIOD_S, clock=lambda: now_s) as writer:
        for topic in range(_N_TOPICS):
            writer.add_topic(f"/topic_{topic}", _TYPE)
        for tick in range(round(_DURATION_S * _RATE_HZ)):
            now_s = tick / _RATE_HZ
            for topic in range(_N_TOPICS):
                writer.write(f"/topic_{topic}", rng.bytes(96), 1 + round(now_s * 1e9))
    file = path / "whole_0.mcap"
    messages, _ = _read(file)
    content = file.read_bytes()
    starts = [start for start in _starts(content) if content[start] == Opcode.CHUNK]
    ends = [*starts[1:], len(content)]
    counts = [len(_read_content(folder, content[:end])[0]) for end in ends]
    return Whole(content, messages, tuple(zip(starts, counts, strict=True)))


def _cuts(folder: Path, whole: Whole, places: Iterable[int]) -> list[Loss]:
    """The file ends at each of the places; lost is what the chunk it ends in held."""
    losses = []
    for place in places:
        taken = max((count for start, count in whole.chunks if start < place), default=0)
        losses.append(_of(folder, whole, whole.content[:place], taken))
    return losses


def _flips(folder: Path, whole: Whole) -> list[Loss]:
    rng = np.random.default_rng(_SEED)
    losses = []
    for place in rng.integers(len(whole.content), size=_N_TRIES):
        broken = bytearray(whole.content)
        broken[place] ^= 1 << int(rng.integers(8))
        losses.append(_of(folder, whole, bytes(broken)))
    return losses


def _zeroed_pages(folder: Path, whole: Whole) -> list[Loss]:
    rng = np.random.default_rng(_SEED)
    losses = []
    for page in rng.integers(len(whole.content) // _PAGE + 1, size=_N_TRIES):
        start = int(page) * _PAGE
        zeros = bytes(min(_PAGE, len(whole.content) - start))
        broken = whole.content[:start] + zeros + whole.content[start + _PAGE :]
        losses.append(_of(folder, whole, broken))
    return losses


def _unfinished(whole: Whole) -> Whole:
    """What a killed recorder leaves: no summary."""
    starts = _starts(whole.content)
    end = next(start for start in starts if whole.content[start] == Opcode.METADATA)
    return replace(whole, content=whole.content[:end])


def _of(folder: Path, whole: Whole, broken: bytes, n_taken: int | None = None) -> Loss:
    """What is lost of the first n_taken messages, None for all."""
    found, detected = _read_content(folder, broken)
    taken = whole.messages[:n_taken]
    lost = sorted(set(taken) - set(found), key=lambda message: message[1])
    lost_s = (lost[-1][1] - lost[0][1]) * 1e-9 + 1 / _RATE_HZ if lost else 0.0
    invented = not set(found) <= set(whole.messages)
    return Loss(len(lost), lost_s, invented or (found != whole.messages and not detected))


def _read(path: Path) -> tuple[tuple[Message, ...], bool]:
    """(messages, whether damage was detected)."""
    scan = McapScan(path)
    found = tuple((each.topic, each.log_time_ns, each.data) for each in scan.messages())
    return found, bool(scan.damage)


def _read_content(folder: Path, content: bytes) -> tuple[tuple[Message, ...], bool]:
    path = folder / "broken.mcap"
    path.write_bytes(content)
    return _read(path)


def _starts(content: bytes) -> list[int]:
    """First byte of each record."""
    offset, starts = MAGIC_SIZE, []
    while offset < len(content) - MAGIC_SIZE:
        starts.append(offset)
        offset += RECORD_HEAD.size + RECORD_HEAD.unpack_from(content, offset)[1]
    return starts


def _middles(content: bytes) -> list[int]:
    starts = _starts(content)
    return [(a + b) // 2 for a, b in zip(starts, [*starts[1:], len(content)], strict=True)]


def _line(name: str, losses: Sequence[Loss]) -> str:
    seconds = [loss.lost_s for loss in losses]
    most = max(loss.n_lost for loss in losses)
    undetected = sum(loss.undetected for loss in losses)
    times = f"{np.mean(seconds):.2f}", f"{max(seconds):.2f}"
    return markdown_row([name, len(losses), *times, most, undetected])
