"""What a bag holds of a drive: poses, intents and episodes, on the clock of the header stamps."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bags.errors import BagError
from bags.messages.plain import vector3_stamped
from serd_app.drives.episode_mark import EpisodeMark
from serd_app.drives.episode_spans import EpisodeSpan, marks_of, spans_of_marks
from serd_core.arrays import FloatArray, IntArray
from serd_core.grid.grid import action_of_direction

POSE, INTENT = "robot_pose", "intent"
NOT_FINITE = "direction not finite"
LONGEST_GAP_S = 0.5


@dataclass(frozen=True, eq=False)
class RecordedDrive:
    """pose_time_s (T,) increasing, position_m (T, 2); intent_time_s, intent_action (N,).

    n_bad_poses: poses left out because a number in them is not finite; n_bad_commands: velocity
    commands likewise.
    n_unplaced_poses: those left out because no transform was recorded about their time.
    dropped: intents that are none already, by why.
    longest_gap_s: between two poses across which the place is still interpolated.
    minimum_speed_mps: mean speed of a period from which on the robot moves.
    cuts: how many episodes without marks end at a gap, a goal, a stop or a turn.
    """

    pose_time_s: FloatArray
    position_m: FloatArray
    intent_time_s: FloatArray
    intent_action: IntArray
    episodes: tuple[EpisodeSpan, ...]
    source: str = ""
    n_bad_poses: int = 0
    n_unplaced_poses: int = 0
    n_bad_commands: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
    longest_gap_s: float = LONGEST_GAP_S
    minimum_speed_mps: float = 0.05
    cuts: Mapping[str, int] = field(default_factory=dict)


class DriveBuilder:
    """Collects a drive message by message: from a bag, from live topics or from a replay alike."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._poses = array("d")
        self._intents = array("d")
        self._marks: list[EpisodeMark] = []

    def add_position(self, time_ns: int, x_m: float, y_m: float) -> None:
        """A pose that was decoded already."""
        self._poses.extend((time_ns / 1e9, x_m, y_m))

    def add_intent(self, data: bytes, time_ns: int) -> None:
        """A geometry_msgs/Vector3Stamped, placed at that time."""
        vector = vector3_stamped(data)
        self._intents.extend((time_ns / 1e9, vector.x, vector.y))

    def add_mark(self, data: bytes, time_ns: int) -> None:
        """A diagnostic_msgs/DiagnosticArray with one status: start or end of an episode."""
        self._marks += marks_of(data, time_ns)

    def drive(self) -> RecordedDrive:
        """Everything so far; BagError where there are poses and none is finite."""
        rows = np.array(self._poses).reshape(-1, 3)
        finite = finite_poses(rows, self._source)
        pose = _unique(finite)
        intent = _unique(np.array(self._intents).reshape(-1, 3))
        clear = np.isfinite(intent).all(axis=1)
        n_unclear = int((~clear).sum())
        return RecordedDrive(
            pose_time_s=pose[:, 0],
            position_m=pose[:, 1:],
            intent_time_s=intent[clear, 0],
            intent_action=actions_of_directions(intent[clear, 1:]),
            episodes=spans_of_marks(self._marks, pose[:, 0], LONGEST_GAP_S),
            source=self._source,
            n_bad_poses=len(rows) - len(finite),
            dropped={NOT_FINITE: n_unclear} if n_unclear else {},
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


def actions_of_directions(directions: FloatArray) -> IntArray:
    """(N,) actions that finite (N, 2) directions east and north mean."""
    actions = [action_of_direction(float(east), float(north)) for east, north in directions]
    return np.array(actions, dtype=np.int64)


def _unique(rows: FloatArray) -> FloatArray:
    """Rows by time, one per stamp: a message that was sent again counts once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]
