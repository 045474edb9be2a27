"""What a bag holds of a drive: poses, intents and episodes, on the clock of the header stamps."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bags.errors import BagError
from bags.messages import messages_of
from serd_core.arrays import FloatArray, IntArray
from serd_core.directions import action_of_direction
from serd_core.errors import SerdError

POSE, INTENT, EPISODE = "robot_pose", "intent", "episode"


@dataclass(frozen=True)
class EpisodeSpan:
    """One marked episode; outcome: arrived, timeout or aborted."""

    number: int
    start_s: float
    end_s: float
    outcome: str


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """pose_time_s (T,) increasing, position_m (T, 2); intent_time_s, intent_action (N,)."""

    pose_time_s: FloatArray
    position_m: FloatArray
    intent_time_s: FloatArray
    intent_action: IntArray
    episodes: tuple[EpisodeSpan, ...]
    source: str = ""


def read_drive(directory: str | Path) -> RecordedDrive:
    """Read a bag; BagError names a topic that is missing or a message that is not finite."""
    directory = Path(directory)
    poses: list[tuple[float, float, float]] = []
    intents: list[tuple[float, int]] = []
    marks: list[tuple[float, str, dict[str, str]]] = []
    for topic, message in messages_of(directory, (POSE, INTENT, EPISODE)):
        time_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        if topic == POSE:
            poses.append((time_s, message.pose.position.x, message.pose.position.y))
        elif topic == INTENT:
            intents.append((time_s, _action(directory, time_s, message.vector)))
        else:
            status = message.status[0]
            values = {item.key: item.value for item in status.values}
            marks.append((time_s, status.message, values))
    pose = _unique(np.array(poses, dtype=np.float64).reshape(-1, 3))
    if not np.isfinite(pose).all():
        where_s = pose[~np.isfinite(pose).all(axis=1)][0, 0]
        raise BagError(f"bag {directory} has a pose that is not finite at {where_s} s; drop it")
    intent = _unique(np.array(intents, dtype=np.float64).reshape(-1, 2))
    return RecordedDrive(
        pose_time_s=pose[:, 0],
        position_m=pose[:, 1:],
        intent_time_s=intent[:, 0],
        intent_action=intent[:, 1].astype(np.int64),
        episodes=_spans(marks),
        source=f"bag {directory.name}",
    )


def _action(directory: Path, time_s: float, vector: Any) -> int:
    try:
        return int(action_of_direction(vector.x, vector.y))
    except SerdError as error:
        raise BagError(f"bag {directory}, intent at {time_s} s: {error}") from None


def _unique(rows: FloatArray) -> FloatArray:
    """Rows by time, one per stamp: a message that was sent again counts once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]


def _spans(marks: list[tuple[float, str, dict[str, str]]]) -> tuple[EpisodeSpan, ...]:
    """Start and end marks as spans; an episode without an end was aborted where the next began."""
    spans: list[EpisodeSpan] = []
    open_mark: tuple[float, int] | None = None
    last_s = 0.0
    for time_s, event, values in sorted(marks, key=lambda mark: mark[0]):
        if open_mark is not None:
            outcome = values["outcome"] if event == "end" else "aborted"
            spans.append(EpisodeSpan(open_mark[1], open_mark[0], time_s, outcome))
        open_mark = (time_s, int(values["episode"])) if event == "start" else None
        last_s = time_s
    if open_mark is not None:
        spans.append(EpisodeSpan(open_mark[1], open_mark[0], max(last_s, open_mark[0]), "aborted"))
    return tuple(spans)
