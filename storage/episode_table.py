"""The table of driven episodes: one CSV row each, rewritten whole so that a crash loses none."""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from storage.atomic import atomic_write_text
from storage.errors import FileError
from storage.text_file import read_text


@dataclass(frozen=True)
class EpisodeResult:
    """How one drive ended; times in simulated seconds, time_of_arrival_s NaN if it did not arrive.

    wall_s: wall time from its first to its last observation, for the real-time factor. reason: why
    its driver gave it up, empty where it did not.
    """

    episode: int
    seed: int
    driver: str
    start_area: str
    outcome: str
    time_of_arrival_s: float
    duration_s: float
    distance_m: float
    robot_on_person: int
    person_on_robot: int
    robot_on_wall: int
    minimum_person_distance_m: float
    wall_s: float
    reason: str = ""

    @property
    def arrived(self) -> bool:
        """Whether the robot reached the goal area in time."""
        return self.outcome == "arrived"


_KINDS: dict[str, Callable[[str], Any]] = {"int": int, "float": float, "str": str}
_FIELDS = {
    field.name: _KINDS[getattr(field.type, "__name__", "")] for field in fields(EpisodeResult)
}


def save_episodes(path: str | Path, episodes: Sequence[EpisodeResult]) -> None:
    """Write all rows; floats read back exactly."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(_FIELDS), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(episode) for episode in episodes)
    atomic_write_text(path, stream.getvalue())


def load_episodes(path: str | Path) -> tuple[EpisodeResult, ...]:
    """Rows of `save_episodes`; FileError names the line that is not one."""
    reader = csv.DictReader(io.StringIO(read_text(path)))
    # Tables written before there was a reason have none.
    if tuple(reader.fieldnames or ()) not in (tuple(_FIELDS), tuple(_FIELDS)[:-1]):
        raise FileError(
            f"{path}: must have the columns {', '.join(_FIELDS)}, got "
            f"{', '.join(reader.fieldnames or ()) or 'none'}; give a table of episodes"
        )
    return tuple(_row(path, reader.line_num, row) for row in reader)


def _row(path: str | Path, line: int, row: dict[str, str]) -> EpisodeResult:
    try:
        result = EpisodeResult(
            **{name: read(row[name]) for name, read in _FIELDS.items() if name in row}
        )
    except (TypeError, ValueError, KeyError) as error:
        raise FileError(f"{path}, line {line}: is no row of episodes ({error}); mend it") from None
    if result.arrived == math.isnan(result.time_of_arrival_s):
        raise FileError(
            f"{path}, line {line}: time_of_arrival_s must be a number exactly if it arrived"
        )
    return result
