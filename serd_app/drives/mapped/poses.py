"""Poses of the robot from the pose topic of a mapping, or from /tf, in the frame of the grid."""

from array import array
from collections.abc import Mapping
from copy import copy

import numpy as np

from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.recorded_drive import finite_poses
from serd_app.drives.transforms import TF_TYPES, Poses, RecordedTransforms
from serd_bag.errors import BagError
from serd_bag.messages.fields import POSES, FieldReader, field_reader
from serd_bag.messages.times import TimesOnClock, agrees, falls_back_s, placed_s
from serd_bag.nearest import hint
from serd_bag.topic import RawMessage, Topic, topic_named, topics_named
from serd_core.arrays import FloatArray, IntArray

_LONGEST_STEP_BACK_S = 1.0
#: Poses in order, of which fewer may be messages that a recorder received late.
_FEWEST_OF_A_RUN = 20
#: Earlier stamps (s since 1970) are of a simulated world, which begins near 0.
_FIRST_REAL_STAMP_S = 1e8
_AT_FRAME = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class MappedPoses:
    """Collects messages of the pose topic and of /tf.

    from_tf: whether the poses are those of `robot_frame`. tree: of /tf so far. has_heading: whether
    poses have one. n_bad: poses left out because a number in them is not finite; see `rows`.
    """

    def __init__(self, known: Mapping[str, Topic], mapping: BagMapping, source: str) -> None:
        self._mapping, self._source = mapping, source
        self._has_clock = bool(topics_named(known, "clock"))
        self._topic = topic_named(known, mapping.pose_topic)
        self.from_tf = known[self._topic].type_name in TF_TYPES
        tf = self._topic.removesuffix("_static") if self.from_tf else "/tf"
        self.tree = RecordedTransforms(known, tf)
        self._read: FieldReader | None = None
        if not self.from_tf:
            self._read = field_reader(
                known[self._topic], mapping.pose_fields, POSES, "pose_fields", "a pose"
            )
        self.has_heading = self._read is None or len(self._read.numbers) > 2
        self._frames: dict[str, int] = {}
        self._rows = array("d")
        self.n_bad = 0

    @property
    def topics(self) -> frozenset[str]:
        """Those to take messages of."""
        return self.tree.topics | {self._topic}

    @property
    def frame_that_corrects(self) -> str:
        """The frame in which /tf moves that of the poses, as a localisation does; else empty."""
        names = list(self._frames)
        return self.tree.frame_that_corrects(names[0]) if len(names) == 1 else ""

    def under(self, mapping: BagMapping) -> "MappedPoses":
        """The same messages with another `frame` and `robot_frame`."""
        other = copy(self)
        other._mapping = mapping
        return other

    def take(self, message: RawMessage) -> None:
        """A message; those of other topics are left."""
        if self.tree.take(message):
            return
        if message.topic == self._topic and self._read is not None:
            header, numbers = self._read(message.data)
            frame = self._frames.setdefault(header.frame.lstrip("/"), len(self._frames))
            times_s = message.log_time_ns / 1e9, header.stamp_ns / 1e9
            self._rows.extend((*times_s, frame, *numbers))

    def rows(self) -> tuple[FloatArray, FloatArray]:
        """(T, 2) log times and the times of the poses in s, these increasing, and (T, 3) x, y and
        yaw, NaN where /tf does not reach."""
        found = self._found()
        rows = finite_poses(found, self._source)
        self.n_bad = len(found) - len(rows)
        rows[:, 1] = self._placed(rows[:, 0], rows[:, 1])
        self._require_one_run(rows[:, 1])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        if not len(rows):
            raise BagError(f"{self._source} has no pose on {self._topic}; check the mapping")
        poses = Poses.of_numbers(rows[:, 3:])
        return rows[:, :2], self._in_frame(poses, rows[:, 1], rows[:, 2].astype(np.int64))

    def _found(self) -> FloatArray:
        """(N, n) log time, stamp, number of the frame, and the numbers of a pose."""
        if self._read is not None:
            return np.array(self._rows).reshape(-1, 3 + len(self._read.numbers))
        robot = self._mapping.robot_frame.lstrip("/")
        if robot not in self.tree.frames:
            raise BagError(
                f"{self._source}: robot_frame must be a frame of {self._topic}, got {robot!r};"
                f" {hint(robot, self.tree.frames)}"
            )
        self._frames = {robot: 0}
        times_s = self.tree.times(self._target, robot)
        return np.column_stack([times_s, np.tile((0.0, *_AT_FRAME), (len(times_s), 1))])

    @property
    def _target(self) -> str:
        """The frame of the grid; of /tf without one in the mapping, the topmost."""
        given = self._mapping.frame.lstrip("/")
        if given or not self.from_tf:
            return given
        return self.tree.root(self._mapping.robot_frame.lstrip("/"))

    def _in_frame(self, poses: Poses, time_s: FloatArray, frame_of: IntArray) -> FloatArray:
        """(N, 3) poses, each given in its own frame, in that of the grid; NaN where /tf does not
        reach."""
        target, tree = self._target, self.tree
        into = poses.planar
        if not target and len(self._frames) > 1:
            raise BagError(
                f"{self._source}: poses on {self._topic} must be given in one frame where the"
                f" mapping names none, got {', '.join(map(repr, self._frames))}; name the frame of"
                " the grid as frame"
            )
        if not target:
            return into
        for name, number in self._frames.items():
            rows = np.flatnonzero(frame_of == number)
            if name != target and len(rows):
                into[rows] = tree.into(target, name, poses.select(rows), time_s[rows]).planar
        if not np.isfinite(into).all(axis=1).any():
            frames = " and ".join(map(repr, self._frames))
            raise BagError(
                f"{self._source}: /tf must join {frames} with {target!r} at the times of"
                f" the poses, {time_s[0]:.1f} s to {time_s[-1]:.1f} s at least once; record /tf"
                " all the time, and on one clock with the poses"
            )
        return into

    def _placed(self, log_s: FloatArray, stamp_s: FloatArray) -> FloatArray:
        """(N,) times of poses: their stamps also where these are of another clock than log times,
        of a simulated world or another machine, which is then the clock of the drive."""
        if agrees(log_s, stamp_s):
            return placed_s(log_s, stamp_s)
        is_set = stamp_s > 0
        between_s = TimesOnClock(log_s[is_set], stamp_s[is_set]).of(log_s)
        by_stamp_s = np.where(is_set, stamp_s, between_s)
        back_s = falls_back_s(by_stamp_s)
        if not (back_s > _LONGEST_STEP_BACK_S).any():
            return by_stamp_s
        simulated = self._has_clock or bool(stamp_s.max() < _FIRST_REAL_STAMP_S)
        if simulated or (falls_back_s(log_s) > _LONGEST_STEP_BACK_S).any():
            self._refuse_two_runs(back_s)
        return log_s

    def _require_one_run(self, time_s: FloatArray) -> None:
        """Runs of a clock that was set back to a time that the first one had, too."""
        back_s = falls_back_s(time_s)
        turns = np.flatnonzero(np.abs(np.diff(back_s, prepend=0.0)) > _LONGEST_STEP_BACK_S)
        runs = [run for run in np.split(time_s, turns) if len(run) >= _FEWEST_OF_A_RUN]
        latest_s = -np.inf
        for first_s, last_s in sorted((run.min(), run.max()) for run in runs):
            if latest_s > first_s + _LONGEST_STEP_BACK_S:
                self._refuse_two_runs(back_s)
            latest_s = max(latest_s, last_s)

    def _refuse_two_runs(self, back_s: FloatArray) -> None:
        """Poses of two runs of a clock, put in order, would be a drive that never took place."""
        row = int(np.argmax(back_s > _LONGEST_STEP_BACK_S))
        raise BagError(
            f"{self._source}: times on {self._topic} must not fall back by more than"
            f" {_LONGEST_STEP_BACK_S:g} s, that of pose {row + 1} does by {back_s[row]:.1f} s:"
            " the world was started again, or a clock was set back; give each run as a bag of its"
            " own"
        )
