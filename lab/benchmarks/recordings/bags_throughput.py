"""Bags: messages per second written, read and turned into decisions, against the rosbags library.

The long drive has poses, intents and people at the rates of the hallway; memory is the peak of a
process of its own that reads a bag of two gigabytes, above that of one that reads a small bag.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from lab.benchmarks.report import Row, best_of, peak_memory_mb, save
from serd_app.demonstrations.discretise import demonstrations_of_bag
from serd_app.drives.drive import END, START, EpisodeMark
from serd_bag.health.check import check_bag
from serd_bag.reader import BagReader
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action, Grid

_N_POSES = 200_000
_PATIENCE_S, _WAIT_S = 4.0, 1.0
_POSE_PERIOD_S = 0.05
_GRID = Grid((0.0, 0.0), 1.0, np.ones((6, 24), dtype=bool))
_POSE = "geometry_msgs/msg/PoseStamped"
_VECTOR = "geometry_msgs/msg/Vector3Stamped"
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_BYTES = "std_msgs/msg/UInt8MultiArray"
_BLOCK = 1_000_000
#: bytes of a message, number of messages
_SIZES = ((50, 100_000), (1_000, 50_000), (20_000, 5_000), (1_000_000, 100), (8_000_000, 12))


def run() -> None:
    """Measure in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        drive = Path(folder) / "drive"
        n_messages, write_s = _write_drive(drive)
        rows: list[Row] = [_row("write", "BagWriter", n_messages, write_s)]
        for work, way, call in (
            ("read bytes", "BagReader", lambda: _count(BagReader(drive).messages())),
            ("read bytes", "rosbags", lambda: _read_with_rosbags(drive, decode=False)),
            ("read and decode", "rosbags", lambda: _read_with_rosbags(drive, decode=True)),
            ("read and discretise", "demonstrations_of_bag", lambda: _discretise(drive)),
            ("check", "check_bag", lambda: check_bag(drive)),
        ):
            rows.append(_row(work, way, n_messages, _seconds(call)))
        rows += [row for size, number in _SIZES for row in _size_rows(Path(folder), size, number)]
        rows += [_memory_row(Path(folder), n_blocks) for n_blocks in (20, 2000)]
    save("bags_throughput", "Messages per second, and memory while reading", rows)


def _row(work: str, way: str, n_messages: int, seconds: float) -> Row:
    return {"work": work, "by": way, "messages": n_messages, "messages/s": n_messages / seconds,
            "peak memory (MB)": ""}  # fmt: skip


def _seconds(call: Callable[[], object]) -> float:
    start_s = time.perf_counter()
    call()
    return time.perf_counter() - start_s


def _count(messages: object) -> int:
    return sum(1 for _ in messages)  # type: ignore[attr-defined]


def _discretise(drive: Path) -> None:
    found, report = demonstrations_of_bag(drive, _GRID, _PATIENCE_S, _WAIT_S)
    assert len(found) == report.n_decisions > 0


def _read_with_rosbags(drive: Path, *, decode: bool) -> None:
    with AnyReader([drive]) as reader:
        for connection, _, data in reader.messages():
            if decode:
                reader.deserialize(data, connection.msgtype)


def _write_drive(folder: Path) -> tuple[int, float]:
    """(messages, seconds) of a drive up and down the hallway; encoding is not counted."""
    rows = _drive_messages()
    start_s = time.perf_counter()
    with BagWriter(folder) as writer:
        for topic, kind in (
            ("/robot_pose", _POSE),
            ("/intent", _VECTOR),
            ("/episode", _DIAGNOSTICS),
        ):
            writer.add_topic(topic, kind)
        for topic, data, time_ns in rows:
            writer.write(topic, data, time_ns)
    return len(rows), time.perf_counter() - start_s


def _drive_messages() -> list[tuple[str, bytes, int]]:
    # Here, so that the process whose memory is measured does without ROS.
    from rclpy.serialization import serialize_message

    from serd_ros.convert.diagnostics import to_episode_message
    from serd_ros.convert.motion import to_intent, to_pose_stamped

    begin, end_s = EpisodeMark(START, 0.0, 0), (_N_POSES - 1) * _POSE_PERIOD_S
    sent: list[tuple[str, object, float]] = [("/episode", to_episode_message(begin), 0.0)]
    for tick in range(_N_POSES):
        time_s = tick * _POSE_PERIOD_S
        x_m = 0.5 + 11.5 * (1.0 - np.cos(time_s / 40.0))
        sent.append(("/robot_pose", to_pose_stamped((x_m, 2.5, 0.0), time_s), time_s))
        if tick % 40 == 0:
            sent.append(("/intent", to_intent(Action.EAST, time_s), time_s))
    end = EpisodeMark(END, end_s, 0, outcome="arrived")
    sent.append(("/episode", to_episode_message(end), end_s))
    return [(topic, serialize_message(each), round(time_s * 1e9)) for topic, each, time_s in sent]


def _size_rows(folder: Path, size: int, number: int) -> list[Row]:
    """Reading messages of one size, by processor time: ours, rosbags, and mcap with checksums."""
    bag = folder / f"size_{size}"
    data = np.random.default_rng(0).bytes(size)
    with BagWriter(bag) as writer:
        writer.add_topic("/bytes", _BYTES)
        for tick in range(number):
            writer.write("/bytes", data, tick)
    ways = {
        "BagReader": lambda: _count(BagReader(bag).messages()),
        "rosbags": lambda: _read_with_rosbags(bag, decode=False),
        "mcap": lambda: _read_with_mcap(bag / f"{bag.name}_0.mcap"),
    }
    rows = [_row(f"read {size} B", way, number, best_of(call)[0]) for way, call in ways.items()]
    shutil.rmtree(bag)
    return rows


def _read_with_mcap(file: Path) -> None:
    with file.open("rb") as stream:
        _count(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))


def _memory_row(folder: Path, n_blocks: int) -> Row:
    """Peak memory of a process that reads that many blocks of a megabyte."""
    bag = folder / f"large_{n_blocks}"
    with BagWriter(bag, max_file_bytes=500_000_000) as writer:
        writer.add_topic("/blocks", _BYTES)
        for number in range(n_blocks):
            writer.write("/blocks", bytes(_BLOCK), number)
    command = [sys.executable, "-m", "lab.benchmarks.recordings.bags_throughput", str(bag)]
    start_s = time.perf_counter()
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    seconds = time.perf_counter() - start_s
    row = dict(_row(f"read {n_blocks} MB", "BagReader", n_blocks, seconds))
    return row | {"peak memory (MB)": float(output)}


if __name__ == "__main__":
    _count(BagReader(Path(sys.argv[1])).messages())
    print(peak_memory_mb())
