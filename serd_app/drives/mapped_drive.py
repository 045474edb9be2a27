"""A drive from any bag, by a mapping file: poses in the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp are put on it by
their log time, through the log times and stamps of the poses, at any rate between the two.
"""

from array import array
from collections.abc import Callable

import numpy as np

from bags.errors import BagError
from bags.messages.plain import (
    PlanarPose,
    odometry,
    pose_stamped,
    pose_with_covariance_stamped,
    transforms,
)
from bags.reader import BagReader
from bags.topic import RawMessage, topic_named
from serd_app.drives.episode_spans import EpisodeMark, EpisodeSpan, marks_of, spans_of_marks
from serd_app.drives.mapped_actions import MappedActions, PoseTrack
from serd_app.drives.mapping import BagMapping
from serd_app.drives.recorded_drive import LONGEST_GAP_S, RecordedDrive, finite_poses, source_of
from serd_app.drives.transforms import TransformTree
from serd_core.arrays import FloatArray, IntArray

_POSE_READERS: dict[str, Callable[[bytes], PlanarPose]] = {
    "geometry_msgs/msg/PoseStamped": pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_with_covariance_stamped,
    "nav_msgs/msg/Odometry": odometry,
}
_TF = {"/tf": False, "/tf_static": True}
UNMARKED = "unmarked"
_LONGEST_STEP_BACK_S = 1.0
#: Without one in the mapping, the longest gap is so many usual steps between poses.
_GAP_STEPS = 5.0


def mapped_drive_in(
    reader: BagReader, mapping: BagMapping, decision_period_s: float
) -> RecordedDrive:
    """The drive in an opened bag; the reader's `damage` then lists what could not be read."""
    return _Collector(reader, mapping).drive(decision_period_s)


class _Collector:
    """Rows of numbers per topic, collected in one pass over the bag."""

    def __init__(self, reader: BagReader, mapping: BagMapping) -> None:
        self._mapping = mapping
        self._source = source_of(reader.path)
        self._pose_topic = topic_named(reader.topics, mapping.pose_topic)
        self._action_topic = topic_named(reader.topics, mapping.action_topic)
        marks = mapping.episode_topic
        self._mark_topic = topic_named(reader.topics, marks) if marks else ""
        self._frames: dict[str, int] = {}
        self._poses = array("d")
        self._actions = MappedActions(mapping, self._action_topic, self._source)
        self._marks: list[EpisodeMark] = []
        self._tree = TransformTree()
        self._read_pose = self._pose_reader(reader.topics[self._pose_topic].type_name)
        wanted = {self._pose_topic, self._action_topic, self._mark_topic, *_TF}
        for message in reader.messages(wanted & set(reader.topics)):
            self._take(message)

    def drive(self, period_s: float) -> RecordedDrive:
        """The drive, with the intents of decision periods of that length."""
        found = np.array(self._poses).reshape(-1, 6)
        rows = finite_poses(found, self._source)
        n_bad_poses = len(found) - len(rows)
        self._require_one_clock(rows[:, 1])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        if not len(rows):
            raise BagError(f"{self._source} has no pose on {self._pose_topic}; check the mapping")
        log_s, time_s = rows[:, 0], rows[:, 1]
        poses = self._in_frame(rows[:, 2:5], time_s, rows[:, 5].astype(np.int64))
        placed = np.isfinite(poses).all(axis=1)
        track = PoseTrack(log_s[placed], time_s[placed], poses[placed])
        longest_gap_s = self._mapping.longest_gap_s or _usual_gap_s(time_s)
        spans = self._spans(track.time_s, longest_gap_s)
        intents = self._actions.intents(track, spans, period_s)
        return RecordedDrive(
            pose_time_s=track.time_s,
            position_m=track.poses[:, :2],
            intent_time_s=intents.time_s,
            intent_action=intents.action,
            episodes=spans,
            source=self._source,
            n_bad_poses=n_bad_poses,
            n_unplaced_poses=int((~placed).sum()),
            n_bad_commands=intents.n_bad_commands,
            dropped=intents.dropped,
            longest_gap_s=longest_gap_s,
        )

    def _in_frame(self, poses: FloatArray, time_s: FloatArray, frame_of: IntArray) -> FloatArray:
        """(N, 3) poses, each given in its own frame, in the one that the mapping names; NaN where
        /tf does not reach."""
        target = self._mapping.frame.lstrip("/")
        if not target:
            self._require_one_frame()
            return poses
        into = poses.copy()
        for name, number in self._frames.items():
            rows = np.flatnonzero(frame_of == number)
            if name != target and len(rows):
                into[rows] = self._tree.into(target, name, poses[rows], time_s[rows])
        if not np.isfinite(into).all(axis=1).any():
            frames = " and ".join(map(repr, self._frames))
            raise BagError(
                f"{self._source}: /tf must join {frames} with {target!r} at the times of"
                f" the poses, {time_s[0]:.1f} s to {time_s[-1]:.1f} s at least once; record /tf"
                " all the time, and on one clock with the poses"
            )
        return into

    def _require_one_frame(self) -> None:
        if len(self._frames) > 1:
            raise BagError(
                f"{self._source}: poses on {self._pose_topic} must be given in one frame where the"
                f" mapping names none, got {', '.join(map(repr, self._frames))}; name the frame of"
                " the grid as frame"
            )

    def _require_one_clock(self, stamp_s: FloatArray) -> None:
        """Poses of two runs of a clock, put in order, would be a drive that never took place."""
        back_s = np.maximum.accumulate(stamp_s) - stamp_s
        if len(stamp_s) and back_s.max() > _LONGEST_STEP_BACK_S:
            row = int(np.argmax(back_s > _LONGEST_STEP_BACK_S))
            raise BagError(
                f"{self._source}: stamps on {self._pose_topic} must not fall back by more than"
                f" {_LONGEST_STEP_BACK_S:g} s, that of pose {row + 1} does by {back_s[row]:.1f} s:"
                " the world was started again; give each run as a bag of its own"
            )

    def _take(self, message: RawMessage) -> None:
        if message.topic in _TF:
            for each in transforms(message.data):
                self._tree.add(each, static=_TF[message.topic])
        if message.topic == self._pose_topic:
            self._take_pose(message)
        if message.topic == self._action_topic:
            self._actions.take(message)
        if message.topic == self._mark_topic:
            self._marks += marks_of(message.data, message.log_time_ns)

    def _take_pose(self, message: RawMessage) -> None:
        pose = self._read_pose(message.data)
        frame = self._frames.setdefault(pose.header.frame.lstrip("/"), len(self._frames))
        stamp_s = (pose.header.stamp_ns or message.log_time_ns) / 1e9
        place = pose.x_m, pose.y_m, pose.yaw_rad
        self._poses.extend((message.log_time_ns / 1e9, stamp_s, *place, frame))

    def _pose_reader(self, type_name: str) -> Callable[[bytes], PlanarPose]:
        if type_name not in _POSE_READERS:
            raise BagError(
                f"pose_topic {self._pose_topic} must be of one of the types"
                f" {', '.join(_POSE_READERS)}, got {type_name}"
            )
        return _POSE_READERS[type_name]

    def _spans(self, time_s: FloatArray, longest_gap_s: float) -> tuple[EpisodeSpan, ...]:
        if self._mark_topic:
            return spans_of_marks(self._marks, time_s, longest_gap_s)
        pieces = np.split(time_s, np.flatnonzero(np.diff(time_s) > longest_gap_s) + 1)
        return tuple(
            EpisodeSpan(number, float(piece[0]), float(piece[-1]), UNMARKED)
            for number, piece in enumerate(pieces)
            if len(piece) > 1
        )


def _usual_gap_s(time_s: FloatArray) -> float:
    """The longest gap for poses that come as often as these: slow topics miss some as well."""
    usual_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    return max(LONGEST_GAP_S, _GAP_STEPS * usual_s)
