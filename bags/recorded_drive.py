"""What a bag holds of a drive: poses, intents and episodes, on the clock of the header stamps."""

from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bags.errors import BagError
from bags.plain_messages import diagnostic_array, pose_position, vector3_stamped
from serd_core.arrays import FloatArray, IntArray
from serd_core.directions import action_of_direction
from serd_core.errors import SerdError

POSE, INTENT, EPISODE = "robot_pose", "intent", "episode"
_START, _END = "start", "end"
CUT_OFF, DISCARDED = "cut_off", "discarded"


@dataclass(frozen=True)
class EpisodeSpan:
    """One marked episode; outcome: arrived, timeout, aborted, discarded, or cut_off where the
    recording has no end of it."""

    number: int
    start_s: float
    end_s: float
    outcome: str


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """pose_time_s (T,) increasing, position_m (T, 2); intent_time_s, intent_action (N,).

    n_bad_poses: poses left out because a number in them is not finite.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    """

    pose_time_s: FloatArray
    position_m: FloatArray
    intent_time_s: FloatArray
    intent_action: IntArray
    episodes: tuple[EpisodeSpan, ...]
    source: str = ""
    n_bad_poses: int = 0
    n_unplaced_poses: int = 0


class DriveBuilder:
    """Collects a drive message by message: from a bag, from live topics or from a replay alike."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._poses = array("d")
        self._intents = array("d")
        self._marks: list[tuple[float, str, dict[str, str]]] = []

    def add_pose(self, data: bytes, log_time_ns: int) -> None:
        """A geometry_msgs/PoseStamped."""
        stamp_ns, x_m, y_m = pose_position(data)
        self.add_position(stamp_ns or log_time_ns, x_m, y_m)

    def add_position(self, time_ns: int, x_m: float, y_m: float) -> None:
        """A pose that was decoded already."""
        self._poses.extend((time_ns / 1e9, x_m, y_m))

    def add_intent(self, data: bytes, log_time_ns: int) -> None:
        """A geometry_msgs/Vector3Stamped."""
        vector = vector3_stamped(data)
        time_s = (vector.header.stamp_ns or log_time_ns) / 1e9
        try:
            action = action_of_direction(vector.x, vector.y)
        except SerdError as error:
            raise BagError(f"{self._source}, intent at {time_s} s: {error}") from None
        self._intents.extend((time_s, float(action)))

    def add_mark(self, data: bytes, log_time_ns: int) -> None:
        """A diagnostic_msgs/DiagnosticArray with one status: start or end of an episode."""
        report = diagnostic_array(data)
        time_s = (report.header.stamp_ns or log_time_ns) / 1e9
        for status in report.statuses:
            if status.name == EPISODE and status.message in (_START, _END):
                self._marks.append((time_s, status.message, status.values))

    def drive(self) -> RecordedDrive:
        """Everything so far; BagError where there are poses and none is finite."""
        rows = np.array(self._poses).reshape(-1, 3)
        pose = _unique(finite_poses(rows, self._source))
        intent = _unique(np.array(self._intents).reshape(-1, 2))
        return RecordedDrive(
            pose_time_s=pose[:, 0],
            position_m=pose[:, 1:],
            intent_time_s=intent[:, 0],
            intent_action=intent[:, 1].astype(np.int64),
            episodes=spans_of_marks(self._marks, float(pose[-1, 0]) if len(pose) else 0.0),
            source=self._source,
            n_bad_poses=len(rows) - int(np.isfinite(rows).all(axis=1).sum()),
        )


def source_of(bag: str | Path) -> str:
    """What tables call a bag: its path as given, since many bags have one name."""
    return f"bag {Path(bag)}"


def finite_poses(rows: FloatArray, source: str) -> FloatArray:
    """The (N, n) rows in which every number is finite; BagError where that is none of them."""
    finite = np.isfinite(rows).all(axis=1)
    if len(rows) and not finite.any():
        raise BagError(
            f"{source} must hold poses that are finite, none of its {len(rows)} is; look at what"
            " published them"
        )
    return rows[finite]


def is_end_mark(data: bytes) -> bool:
    """Whether a diagnostic_msgs/DiagnosticArray marks the end of an episode."""
    return any(
        status.name == EPISODE and status.message == _END
        for status in diagnostic_array(data).statuses
    )


def _unique(rows: FloatArray) -> FloatArray:
    """Rows by time, one per stamp: a message that was sent again counts once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]


def spans_of_marks(
    marks: list[tuple[float, str, dict[str, str]]], last_pose_s: float
) -> tuple[EpisodeSpan, ...]:
    """Start and end marks as spans; one without an end is cut off at the next start or the end.

    An episode that has ended can be taken back: a second end mark with its number and the outcome
    discarded, whenever it comes, counts in the place of the first.
    """
    taken_back = {
        _number(values)
        for _, event, values in marks
        if event == _END and values.get("outcome") == DISCARDED
    }
    spans: list[EpisodeSpan] = []
    open_mark: tuple[float, int] | None = None
    for time_s, event, values in sorted(marks, key=lambda mark: mark[0]):
        if open_mark is not None:
            outcome = values.get("outcome", "") if event == _END else CUT_OFF
            outcome = DISCARDED if open_mark[1] in taken_back else outcome
            spans.append(EpisodeSpan(open_mark[1], open_mark[0], time_s, outcome))
        open_mark = (time_s, _number(values)) if event == _START else None
    if open_mark is not None:
        end_s = max(last_pose_s, open_mark[0])
        spans.append(EpisodeSpan(open_mark[1], open_mark[0], end_s, CUT_OFF))
    return tuple(spans)


def _number(values: dict[str, str]) -> int:
    text = values.get("episode", "")
    if not text.isdecimal():
        raise BagError(f"episode mark must carry the episode's number, got {text!r}")
    return int(text)
