"""Recordings of every kind, each by the commands that a person would type first: the table in
docs/sources.md.

A bag of another robot: `serd bag suggest`, then `serd demos`; a table: `serd demos` alone. The
first attempt is a success where both end without an error and leave decisions to learn from.

python -m lab sources
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.rosbag2 import StoragePlugin

from lab.benchmarks.recordings import written_drives as written
from lab.benchmarks.recordings.held_out import held_out
from lab.benchmarks.report import markdown_row, write_rows
from serd_bag.files import atomic_write_text
from serd_files.errors import USER_ERRORS

_ROOT = Path(__file__).absolute().parents[3]
_DOCUMENT = _ROOT / "docs" / "sources.md"
_REAL = _ROOT.parent / "shared" / "data"
_OWN = _ROOT / "bags" / "data" / "hallway" / "test"
#: Of the table that is written.
_FIRST_COLUMNS = "source", "kind"
_REAL_BAG = _REAL / "bags" / "test-bag"
_CORRIDOR = _REAL / "pedestrians" / "bi_corr_400_b_03.txt"
_HALL = ("--scenario", "hallway")


@dataclass(frozen=True)
class Source:
    """kind: ROS 2, ROS 1, own or table; real: whether others recorded it; make: writes the file in
    a folder, or finds it; options: of 'serd demos'."""

    name: str
    kind: str
    real: bool
    make: Callable[[Path], Path]
    options: tuple[str, ...]
    mapping: str = ""


def _fixed(path: Path) -> Callable[[Path], Path]:
    return lambda _: path


def _ros2(topics: str, storage: StoragePlugin) -> Callable[[Path], Path]:
    return lambda folder: written.write_ros2(
        folder / "bag", written.driven_in(_OWN), written.TOPICS[topics], storage
    )


def _ros1(topics: str) -> Callable[[Path], Path]:
    return lambda folder: written.write_ros1(
        folder / "drive.bag", written.driven_in(_OWN), written.TOPICS[topics]
    )


def _people(write: Callable[..., Path], name: str) -> Callable[[Path], Path]:
    return lambda folder: write(folder / name, written.people_of(_CORRIDOR))


def _poses(write: Callable[..., Path], bag: Path) -> Callable[[Path], Path]:
    return lambda folder: write(folder / "poses.txt", written.driven_in(bag))


def _pedestrians(name: str) -> Callable[[Path], Path]:
    return _fixed(_REAL / "pedestrians" / f"{name}.txt")


_MCAP, _SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3
_ROOM, _METRE = (("--cell-size-m", size_m, "--period-s", "1") for size_m in ("0.5", "1"))
_UO = "fps: 16\n"
_TF = "pose_topic: tf\naction_from: motion\n"
_NAMED, _ETH = written.write_named, written.write_eth
SOURCES = (
    Source("Neato robot, sqlite3", "ROS 2", True, _fixed(_REAL_BAG), _ROOM),
    Source("the same by its /tf alone", "ROS 2", True, _fixed(_REAL_BAG), _ROOM, _TF),
    Source("our recorder, MCAP", "own", False, _fixed(_OWN), _HALL),
    Source("odometry and Twist, sqlite3", "ROS 2", False, _ros2("twist", _SQLITE), _HALL),
    Source("odometry and Ackermann, MCAP", "ROS 2", False, _ros2("steered", _MCAP), _HALL),
    Source("/tf and Twist, MCAP", "ROS 2", False, _ros2("tf", _MCAP), _HALL),
    Source("odometry and Twist, bz2", "ROS 1", False, _ros1("twist"), _HALL),
    Source("corridor in two directions, PeTrack", "people", True, _fixed(_CORRIDOR), _METRE),
    Source("corridor, moderate", "people", True, _pedestrians("uo-100-180-180"), _METRE, _UO),
    Source("corridor, dense", "people", True, _pedestrians("uo-180-180-120"), _METRE, _UO),
    Source("corridor as ETH/UCY text", "people", False, _people(_ETH, "crowd.txt"), _METRE),
    Source("corridor as CSV", "people", False, _people(_NAMED, "tracks.csv"), _METRE),
    Source("corridor as Parquet", "people", False, _people(_NAMED, "tracks.parquet"), _METRE),
    Source("hallway drives as TUM", "poses", False, _poses(written.write_tum, _OWN), _HALL),
    Source("Neato robot as TUM", "poses", False, _poses(written.write_tum, _REAL_BAG), _ROOM),
    Source("Neato robot as KITTI", "poses", False, _poses(written.write_kitti, _REAL_BAG), _ROOM),
)


@dataclass(frozen=True)
class Row:
    """What a source gave; error: of the first command that failed."""

    source: Source
    n_decisions: int = 0
    n_episodes: int = 0
    n_moving_waits: int = 0
    likelihood: str = "-"
    error: str = ""

    def line(self) -> str:
        """The row of the table."""
        source = self.source
        cells = (
            source.name,
            source.kind,
            "real" if source.real else "generated",
            "yes" if not self.error else f"no: {self.error}",
            self.n_decisions,
            self.n_episodes,
            self.n_moving_waits,
            self.likelihood,
        )
        return markdown_row(cells)


def run() -> None:
    """Measure all sources and write the rows of the document."""
    rows = []
    for each in SOURCES:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(_measured(each, Path(folder)))
        print(rows[-1].line(), end="", flush=True)
    write_rows(_DOCUMENT, _FIRST_COLUMNS, "".join(row.line() for row in rows))


def _measured(source: Source, folder: Path) -> Row:
    path = source.make(folder)
    table = folder / "decisions.csv"
    try:
        words = ("demos", path, *source.options, *_mapping(source, path, folder), "--output", table)
        (found,) = json.loads(serd(*words, "--json"))["bags"]
    except _RefusedError as refused:
        return Row(source, error=str(refused))
    counts = tuple(found[name] for name in ("n_decisions", "n_episodes", "n_moving_waits"))
    try:
        measured = held_out(table)
    except USER_ERRORS as error:
        return Row(source, *counts, error=str(error))
    against = f"{measured.learned:.3f} against {measured.uniform:.3f} ({measured.n})"
    return Row(source, *counts, likelihood=against)


def _mapping(source: Source, path: Path, folder: Path) -> Iterator[str | Path]:
    """Options of 'serd demos': a mapping given, or for bags of others one suggested."""
    if not source.mapping and source.kind not in ("ROS 1", "ROS 2"):
        return
    mapping = folder / "mapping.yaml"
    if source.mapping:
        atomic_write_text(mapping, source.mapping)
    else:
        serd("bag", "suggest", path, "--output", mapping)
    yield from ("--mapping", mapping)


class _RefusedError(Exception):
    """A command ended with an error, whose last line this is."""


def serd(*words: str | Path) -> str:
    """What a command prints; _RefusedError where it ends with an error."""
    command = [str(Path(sys.executable).with_name("serd")), *map(str, words)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode:
        raise _RefusedError((ended.stderr.strip().splitlines() or ["no message"])[-1])
    return ended.stdout
