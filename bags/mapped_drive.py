"""A drive out of anybody's bag, by a mapping file: poses into the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp are put on it by
their log time, through the log times and stamps of the poses, whatever the rate between the two.
"""

from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bags.errors import BagError
from bags.inferred_actions import actions_of_velocities, actions_of_waypoints
from bags.mapping import BagMapping
from bags.plain_messages import (
    PlanarPose,
    diagnostic_array,
    odometry,
    pose_stamped,
    transforms,
    twist,
    vector3_stamped,
)
from bags.reader import BagReader, RawMessage, topic_named
from bags.recorded_drive import (
    EpisodeSpan,
    RecordedDrive,
    finite_poses,
    source_of,
    spans_of_marks,
)
from bags.transforms import TransformTree
from serd_core.arrays import FloatArray, IntArray
from serd_core.directions import action_of_direction
from serd_core.errors import SerdError

_POSE_READERS: dict[str, Callable[[bytes], PlanarPose]] = {
    "geometry_msgs/msg/PoseStamped": pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_stamped,
    "nav_msgs/msg/Odometry": odometry,
}
_TF = {"/tf": False, "/tf_static": True}
_UNMARKED = "unmarked"
_STAMP_TOLERANCE_S = 1e-6
_LONGEST_STEP_BACK_S = 1.0


def read_mapped_drive(
    path: str | Path, mapping: BagMapping, decision_period_s: float
) -> RecordedDrive:
    """The drive; BagError names a topic, type or frame that is not as the mapping says."""
    return _Collector(BagReader(path), mapping).drive(decision_period_s)


class _Collector:
    """Rows of numbers per topic, collected in one pass over the bag."""

    def __init__(self, reader: BagReader, mapping: BagMapping) -> None:
        self._mapping = mapping
        self._source = source_of(reader.path)
        self._pose_topic = topic_named(reader.topics, mapping.pose_topic)
        self._action_topic = topic_named(reader.topics, mapping.action_topic)
        marks = mapping.episode_topic
        self._mark_topic = topic_named(reader.topics, marks) if marks else ""
        self._pose_frame = ""
        self._poses = array("d")
        self._actions = array("d")
        self._marks: list[tuple[float, str, dict[str, str]]] = []
        self._tree = TransformTree()
        self._read_pose = self._pose_reader(reader.topics[self._pose_topic].type_name)
        wanted = {self._pose_topic, self._action_topic, self._mark_topic, *_TF}
        for message in reader.messages(wanted & set(reader.topics)):
            self._take(message)

    def drive(self, period_s: float) -> RecordedDrive:
        """Everything together."""
        found = np.array(self._poses).reshape(-1, 5)
        rows = finite_poses(found, self._source)
        n_bad_poses = len(found) - len(rows)
        self._require_one_clock(rows[:, 1])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        if not len(rows):
            raise BagError(f"{self._source} has no pose on {self._pose_topic}; check the mapping")
        log_s, time_s, poses = rows[:, 0], rows[:, 1], rows[:, 2:]
        poses = self._in_frame(poses, time_s)
        placed = np.isfinite(poses).all(axis=1)
        log_s, time_s, poses = log_s[placed], time_s[placed], poses[placed]
        spans = self._spans(time_s)
        intent_s, actions = self._intents(log_s, time_s, poses, spans, period_s)
        return RecordedDrive(
            time_s,
            poses[:, :2],
            intent_s,
            actions,
            spans,
            self._source,
            n_bad_poses,
            n_unplaced_poses=int((~placed).sum()),
        )

    def _in_frame(self, poses: FloatArray, time_s: FloatArray) -> FloatArray:
        """(N, 3) poses in the frame that the mapping names; NaN where /tf does not reach."""
        frame = self._mapping.frame
        if not frame or frame.lstrip("/") == self._pose_frame:
            return poses
        into = self._tree.into(frame, self._pose_frame, poses, time_s)
        if not np.isfinite(into).all(axis=1).any():
            raise BagError(
                f"{self._source}: /tf must join {self._pose_frame!r} with {frame!r} at the times of"
                f" the poses, {time_s[0]:.1f} s to {time_s[-1]:.1f} s, it never does; record /tf"
                " all the time, and on one clock with the poses"
            )
        return into

    def _require_one_clock(self, stamp_s: FloatArray) -> None:
        """Poses of two runs of a clock, put in order, would be a drive that never was."""
        back_s = np.maximum.accumulate(stamp_s) - stamp_s
        if len(stamp_s) and back_s.max() > _LONGEST_STEP_BACK_S:
            row = int(np.argmax(back_s > _LONGEST_STEP_BACK_S))
            raise BagError(
                f"{self._source}: stamps on {self._pose_topic} must not fall back by more than"
                f" {_LONGEST_STEP_BACK_S:g} s, that of pose {row + 1} does by {back_s[row]:.1f} s:"
                " the world was started again; give each run as a bag of its own"
            )

    def _take(self, message: RawMessage) -> None:
        log_s = message.log_time_ns / 1e9
        if message.topic in _TF:
            for each in transforms(message.data):
                self._tree.add(each, static=_TF[message.topic])
        if message.topic == self._pose_topic:
            pose = self._read_pose(message.data)
            self._pose_frame = pose.header.frame.lstrip("/")
            stamp_s = (pose.header.stamp_ns or message.log_time_ns) / 1e9
            self._poses.extend((log_s, stamp_s, pose.x_m, pose.y_m, pose.yaw_rad))
        if message.topic == self._action_topic:
            self._actions.extend((log_s, *self._action_row(message)))
        if message.topic == self._mark_topic:
            report = diagnostic_array(message.data)
            stamp_s = (report.header.stamp_ns or message.log_time_ns) / 1e9
            self._marks += [(stamp_s, each.message, each.values) for each in report.statuses]

    def _pose_reader(self, type_name: str) -> Callable[[bytes], PlanarPose]:
        if type_name not in _POSE_READERS:
            raise BagError(
                f"pose_topic {self._pose_topic} must be of one of the types"
                f" {', '.join(_POSE_READERS)}, got {type_name}"
            )
        return _POSE_READERS[type_name]

    def _action_row(self, message: RawMessage) -> tuple[float, float, float]:
        """(stamp in s or NaN, x, y)."""
        kind = self._mapping.action_from, message.type_name.rsplit("/", 1)[-1]
        if kind == ("velocity", "Twist"):
            return (np.nan, *twist(message.data))
        if kind == ("waypoint", "PoseStamped"):
            pose = pose_stamped(message.data)
            return _stamp_s(pose.header.stamp_ns), pose.x_m, pose.y_m
        if kind in (("velocity", "TwistStamped"), ("intent", "Vector3Stamped")):
            vector = vector3_stamped(message.data)
            return _stamp_s(vector.header.stamp_ns), vector.x, vector.y
        raise BagError(
            f"action_topic {message.topic} must carry Twist or TwistStamped (velocity),"
            f" PoseStamped (waypoint) or Vector3Stamped (intent), got {message.type_name} for"
            f" {self._mapping.action_from}"
        )

    def _spans(self, time_s: FloatArray) -> tuple[EpisodeSpan, ...]:
        if self._mark_topic:
            return spans_of_marks(self._marks, float(time_s[-1]))
        pieces = np.split(time_s, np.flatnonzero(np.diff(time_s) > self._mapping.longest_gap_s) + 1)
        return tuple(
            EpisodeSpan(number, float(piece[0]), float(piece[-1]), _UNMARKED)
            for number, piece in enumerate(pieces)
            if len(piece) > 1
        )

    def _intents(
        self,
        log_s: FloatArray,
        time_s: FloatArray,
        poses: FloatArray,
        spans: tuple[EpisodeSpan, ...],
        period_s: float,
    ) -> tuple[FloatArray, IntArray]:
        """(N,) decision times and (N,) actions."""
        rows = np.array(self._actions).reshape(-1, 4)
        order = np.argsort(log_s, kind="stable")
        aligned_s = np.interp(rows[:, 0], log_s[order], time_s[order])
        at_s = np.where(np.isnan(rows[:, 1]), aligned_s, rows[:, 1])
        order = np.argsort(at_s, kind="stable")
        at_s, vectors = at_s[order], rows[order, 2:]
        if not np.isfinite(vectors).all():
            raise BagError(
                f"{self._source} has a number that is not finite on {self._action_topic}"
            )
        if self._mapping.action_from == "velocity":
            decided_s = _ticks(spans, period_s)
            return decided_s, actions_of_velocities(
                decision_time_s=decided_s,
                period_s=period_s,
                command_time_s=at_s,
                command_mps=vectors,
                pose_time_s=time_s,
                yaw_rad=poses[:, 2],
                hold_s=self._mapping.hold_s,
                minimum_speed_mps=self._mapping.minimum_speed_mps,
            )
        if self._mapping.action_from == "waypoint":
            place = np.stack([np.interp(at_s, time_s, each) for each in poses[:, :2].T], axis=1)
            return at_s, actions_of_waypoints(
                position_m=place, waypoint_m=vectors, reached_m=self._mapping.waypoint_reached_m
            )
        try:
            actions = [action_of_direction(east, north) for east, north in vectors]
        except SerdError as error:
            raise BagError(f"{self._source}: {error}") from None
        return at_s, np.array(actions, dtype=np.int64)


def _ticks(spans: tuple[EpisodeSpan, ...], period_s: float) -> FloatArray:
    """Decision times: every period from the start of each episode."""
    ticks = [np.arange(span.start_s, span.end_s - _STAMP_TOLERANCE_S, period_s) for span in spans]
    return np.concatenate(ticks) if ticks else np.zeros(0)


def _stamp_s(stamp_ns: int) -> float:
    return stamp_ns / 1e9 if stamp_ns else float("nan")
