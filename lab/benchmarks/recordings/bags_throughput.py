"""Bags: processor time of reading and copying, against rosbags and mcap; writing and checking.

The long drive has poses, intents and people at the rates of the hallway; memory is the peak of a
process of its own that reads a bag of two gigabytes, above that of one that reads a small bag.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import McapReader, make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapFileWriter
from rosbags import rosbag2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from lab.benchmarks.recordings.broken_bags import FORMATS, recorded
from lab.benchmarks.report import Row, best_of, peak_memory_mb, save
from serd_app.drives.drive import END, START, EpisodeMark
from serd_bag.command.rewrite import convert
from serd_bag.health.check import check_bag
from serd_bag.health.contents import contents_of_bag
from serd_bag.reader import BagReader
from serd_bag.verbs.cut import cut
from serd_bag.writer import BagWriter
from serd_core.grid.grid import Action

_N_POSES = 200_000
_POSE_PERIOD_S = 0.05
_POSE = "geometry_msgs/msg/PoseStamped"
_VECTOR = "geometry_msgs/msg/Vector3Stamped"
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_BYTES = "std_msgs/msg/UInt8MultiArray"
_BLOCK = 1_000_000
#: bytes of a message, number of messages
_SIZES = ((100, 50_000), (1_000_000, 100))


def run() -> None:
    """Measure in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        drive = Path(folder) / "drive"
        n_messages, write_s = _write_drive(drive)
        rows: list[Row] = [_row("write", "BagWriter", n_messages, write_s)]
        rows.append(_row("check", "check_bag", n_messages, _seconds(lambda: check_bag(drive))))
        rows += [_memory_row(Path(folder), n_blocks) for n_blocks in (20, 2000)]
        speed = [row for each in _SIZES for row in _speed_rows(Path(folder), *each)]
    save("bags_speed", "Processor time of reading and copying, against rosbags and mcap", speed)
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


def _read_with_rosbags(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        _count(reader.messages())


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


def _speed_rows(folder: Path, size: int, number: int) -> list[Row]:
    """Processor time with messages of one size in each format, and its ratio to the faster library.

    Messages are read as the file has them. `convert` and `cut` are compared with reading by a
    library and writing MCAP without compression by it, `info` with opening the file.
    """
    rows: list[Row] = []
    for form in ("MCAP", "MCAP zstd", "MCAP lz4", "sqlite3", "ROS 1"):
        place = folder / f"{size} {form}"
        place.mkdir()
        for work, calls in _works(FORMATS[form](place, recorded(number, size))).items():
            ours, rosbags, *mcap = [best_of(call)[0] for call in calls]
            row = {"format": form, "bytes": size, "messages": number, "work": work}
            row |= {"serd-bag (s)": ours, "rosbags (s)": rosbags, "mcap (s)": (mcap or [""])[0]}
            rows.append({**row, "ratio": ours / min([rosbags, *mcap])})
    return rows


def _works(file: Path) -> dict[str, tuple[Callable[[], object], ...]]:
    """Each work by serd-bag, by rosbags and, of MCAP files, by mcap."""
    is_ros1 = file.suffix == ".bag"
    bag = file if is_ros1 else file.parent
    read = BagReader.records if is_ros1 else BagReader.messages
    found: dict[str, tuple[Callable[[], object], ...]] = {
        "read": (lambda: _count(read(BagReader(bag))), lambda: _read_with_rosbags(bag)),
        "convert": (lambda: _new(convert, bag), lambda: _new(_copy_with_rosbags, bag)),
        "cut": (lambda: _new(cut, [bag]), lambda: _new(_copy_with_rosbags, bag)),
        "info": (lambda: contents_of_bag(bag), lambda: AnyReader([bag]).open()),
    }
    if file.suffix == ".mcap":
        found["read"] += (
            lambda: _with_mcap(
                file, lambda each: _count(each.iter_messages(None, None, None, False))
            ),
        )
        found["convert"] += (lambda: _new(_copy_with_mcap, file),)
        found["cut"] += found["convert"][2:]
        found["info"] += (lambda: _with_mcap(file, lambda each: each.get_summary()),)
    return found


def _new(write: Callable[..., object], source: object) -> None:
    with tempfile.TemporaryDirectory() as folder:
        write(source, Path(folder) / "copy")


def _copy_with_rosbags(bag: Path, target: Path) -> None:
    kind, store = rosbag2.StoragePlugin.MCAP, get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([bag]) as reader, rosbag2.Writer(target, version=9, storage_plugin=kind) as made:
        topics = {
            each.id: made.add_connection(each.topic, each.msgtype, typestore=store)
            for each in reader.connections
        }
        for each, time_ns, data in reader.messages():
            cdr = store.ros1_to_cdr(data, each.msgtype) if bag.suffix == ".bag" else data
            made.write(topics[each.id], time_ns, cdr)


def _with_mcap(file: Path, use: Callable[[McapReader], object]) -> None:
    with file.open("rb") as stream:
        use(make_reader(stream, validate_crcs=True))


def _count_in_file_order(reader: McapReader) -> None:
    _count(reader.iter_messages(log_time_order=False))


def _copy_with_mcap(file: Path, target: Path) -> None:
    writer, channels = McapFileWriter(str(target), compression=CompressionType.NONE), {}
    writer.start("ros2")
    with file.open("rb") as stream:
        for schema, each, message in make_reader(stream).iter_messages(log_time_order=False):
            if each.topic not in channels and schema is not None:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[each.topic] = writer.register_channel(each.topic, "cdr", number)
            channel = channels[each.topic]
            writer.add_message(channel, message.log_time, message.data, message.publish_time)
    writer.finish()


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
