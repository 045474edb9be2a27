"""A drive from any bag, by a mapping file: poses in the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp, or with a stamp
of another clock, are put on it by their log time, through the log times and stamps of the poses, at
any rate between the two (`bags/serd_bag/messages/times.py`).
"""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from serd_app.drives.actions import MappedActions, PoseTrack, posed_intents
from serd_app.drives.drive import (
    NO_PAUSES,
    EpisodeMark,
    EpisodeSpan,
    RecordedDrive,
    finite_poses,
    marks_of,
    source_of,
    spans_of_marks,
    without_pauses,
)
from serd_app.drives.fields import POSES, FieldReader, field_reader
from serd_app.drives.mapping import BagMapping, unmarked_spans, usual_gap_s
from serd_app.drives.sessions import paused_s
from serd_app.drives.transforms import TF_TYPES, RecordedTransforms, matrices_of, plain_name, planar
from serd_bag.errors import BagError
from serd_bag.messages.times import TimesOnClock, agrees, falls_back_s, placed_s
from serd_bag.nearest import hint
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, Topic, topic_named, topics_named
from serd_core.arrays import FloatArray, IntArray

_LONGEST_STEP_BACK_S = 1.0
#: Poses in order, of which fewer may be messages that a recorder received late.
_FEWEST_OF_A_RUN = 20
#: Earlier stamps (s since 1970) are of a simulated world, which begins near 0.
_FIRST_REAL_STAMP_S = 1e8
#: Poses that are placed at once, as matrices.
_AT_ONCE = 100_000
_AT_FRAME = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def mapped_drive_in(reader: BagReader, mapping: BagMapping) -> RecordedDrive:
    """The drive in an opened bag; the reader's `damage` then lists what could not be read.

    BagError where the topics do not hold what the mapping needs.
    """
    collected = mapped_messages(reader.topics, mapping, source_of(reader.path))
    for message in reader.messages(collected.topics & set(reader.topics)):
        collected.take(message)
    return collected.drive(paused_s(reader))


def mapped_messages(
    known: Mapping[str, Topic], mapping: BagMapping, source: str
) -> "MappedMessages":
    """Collects the messages of a mapping; known: topics of a bag, or of live publishers."""
    poses, actions = MappedPoses(known, mapping, source), None
    if mapping.has_action_topic:
        actions = MappedActions(mapping, known[topic_named(known, mapping.action_topic)], source)
    marks = topic_named(known, mapping.episode_topic) if mapping.episode_topic else ""
    return MappedMessages(mapping, source, poses, actions, marks)


@dataclass(frozen=True, eq=False)
class MappedMessages:
    """Messages of the topics of a mapping; marks: of episodes, with their log times in s.

    actions: None where these are of the poses.
    """

    mapping: BagMapping
    source: str
    poses: "MappedPoses"
    actions: MappedActions | None
    mark_topic: str = ""
    marks: list[tuple[float, EpisodeMark]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.mapping.action_from == "velocity" and not self.poses.has_heading:
            raise BagError(
                f"{self.source}: pose_topic {self.mapping.pose_topic} must have a heading, by"
                " which velocities are turned, it has x and y alone; name a third path in"
                " pose_fields, or set action_from: hidden"
            )

    @property
    def topics(self) -> set[str]:
        """Those to take messages of."""
        actions = self.actions.topics if self.actions else ()
        return {*self.poses.topics, *actions, self.mark_topic} - {""}

    def take(self, message: RawMessage) -> None:
        """A message of one of them; BagError where it is damaged."""
        self.poses.take(message)
        if self.actions is not None and message.topic in self.actions.topics:
            self.actions.take(message)
        if message.topic == self.mark_topic:
            log_s = message.log_time_ns / 1e9
            self.marks.extend((log_s, mark) for mark in marks_of(message.data))

    def drive(self, paused_log_s: FloatArray = NO_PAUSES) -> RecordedDrive:
        """The drive of all messages so far; paused_log_s: (P,) when the recorder was paused."""
        mapping, track = self.mapping, self.poses.track(self.mapping)
        longest_gap_s = mapping.longest_gap_s or self.poses.usual_gap_s
        spans, cuts = self._spans(track, longest_gap_s)
        pauses_s = track.placed(paused_log_s, np.zeros_like(paused_log_s))
        spans = without_pauses(spans, track.time_s, pauses_s)
        if self.actions is None:
            intents = posed_intents(mapping, track, spans)
        else:
            intents = self.actions.intents(mapping, track, spans)
        return RecordedDrive(
            pose_time_s=track.time_s,
            position_m=track.poses[:, :2],
            episodes=spans,
            source=self.source,
            n_bad_poses=self.poses.n_bad,
            n_unplaced_poses=self.poses.n_unplaced,
            longest_gap_s=longest_gap_s,
            minimum_speed_mps=mapping.minimum_speed_mps,
            cuts=cuts,
            **intents,
        )

    def _spans(
        self, track: PoseTrack, longest_gap_s: float
    ) -> tuple[tuple[EpisodeSpan, ...], Mapping[str, int]]:
        """Episodes, and what those without marks were cut at."""
        if not self.mark_topic:
            return unmarked_spans(track.time_s, track.poses[:, :2], longest_gap_s, self.mapping)
        rows = np.array([(log_s, mark.time_s) for log_s, mark in self.marks]).reshape(-1, 2)
        placed = zip(track.placed(*rows.T), self.marks, strict=True)
        marks = (replace(mark, time_s=float(at_s)) for at_s, (_, mark) in placed)
        return spans_of_marks(marks, track.time_s, longest_gap_s), {}


class MappedPoses:
    """Poses of the robot from the pose topic, or from /tf, in the frame of the grid.

    from_tf: whether the poses are those of `robot_frame`. tree: of /tf so far. has_heading: whether
    poses have one. Set by `track`: n_bad, n_unplaced, poses left out because a number in them is
    not finite, or where /tf does not reach; usual_gap_s: by how often poses come.
    """

    def __init__(self, known: Mapping[str, Topic], mapping: BagMapping, source: str) -> None:
        self._source = source
        self._has_clock = bool(topics_named(known, "clock"))
        self._topic = topic_named(known, mapping.pose_topic)
        topic = known[self._topic]
        self.from_tf = topic.type_name in TF_TYPES
        tf = self._topic.removesuffix("_static") if self.from_tf else "/tf"
        self.tree = RecordedTransforms(known, tf)
        self._read: FieldReader | None = None
        if not self.from_tf:
            paths = mapping.pose_fields
            self._read = field_reader(topic, paths, POSES, "pose_fields", "a pose")
        self.has_heading = self._read is None or len(self._read.numbers) > 2
        self.topics = self.tree.topics | {self._topic}
        self._frames: dict[str, int] = {}
        self._rows = array("d")
        self.n_bad = self.n_unplaced = 0
        self.usual_gap_s = 0.0

    @property
    def frame_that_corrects(self) -> str:
        """The frame in which /tf moves that of the poses, as a localisation does; else empty."""
        names = list(self._frames)
        return self.tree.frame_that_corrects(names[0]) if len(names) == 1 else ""

    def take(self, message: RawMessage) -> None:
        """A message; those of other topics are left."""
        if self.tree.take(message):
            return
        if message.topic == self._topic and self._read is not None:
            header, numbers = self._read(message.data)
            frame = self._frames.setdefault(plain_name(header.frame), len(self._frames))
            times_s = message.log_time_ns / 1e9, header.stamp_ns / 1e9
            self._rows.extend((*times_s, frame, *numbers))

    def track(self, mapping: BagMapping) -> PoseTrack:
        """The poses that are finite and that /tf reaches, by `frame` and `robot_frame`."""
        target = plain_name(mapping.frame)
        if self._read is None:
            robot = plain_name(mapping.robot_frame)
            target = target or self.tree.root(robot)
            found = self._poses_of_frame(robot, target)
        else:
            found = np.array(self._rows).reshape(-1, 3 + len(self._read.numbers))
        rows = finite_poses(found, self._source)
        self.n_bad = len(found) - len(rows)
        rows[:, 1] = self._placed(rows[:, 0], rows[:, 1])
        self._require_one_run(rows[:, 1])
        rows = rows[np.unique(rows[:, 1], return_index=True)[1]]
        if not len(rows):
            raise BagError(f"{self._source} has no pose on {self._topic}; check the mapping")
        self.usual_gap_s = usual_gap_s(rows[:, 1])
        frame_of = rows[:, 2].astype(np.int64)
        in_grid = self._in_frame(target, rows[:, 3:], rows[:, 1], frame_of)
        placed = np.isfinite(in_grid).all(axis=1)
        self.n_unplaced = int((~placed).sum())
        return PoseTrack(rows[placed, 0], rows[placed, 1], in_grid[placed])

    def _poses_of_frame(self, robot: str, target: str) -> FloatArray:
        """(N, 10) log time, stamp, number of the frame, and a pose at its origin."""
        if robot not in self.tree.names:
            raise BagError(
                f"{self._source}: robot_frame must be a frame of {self._topic}, got {robot!r};"
                f" {hint(robot, self.tree.names)}"
            )
        self._frames = {robot: 0}
        times_s = self.tree.times(target, robot)
        return np.column_stack([times_s, np.tile((0.0, *_AT_FRAME), (len(times_s), 1))])

    def _in_frame(
        self, target: str, numbers: FloatArray, time_s: FloatArray, frame_of: IntArray
    ) -> FloatArray:
        """(N, 3) poses, each given in its own frame, in that of the grid; NaN where /tf does not
        reach."""
        into = np.zeros((len(numbers), 3))
        if not target and len(self._frames) > 1:
            raise BagError(
                f"{self._source}: poses on {self._topic} must be given in one frame where the"
                f" mapping names none, got {', '.join(map(repr, self._frames))}; name the frame of"
                " the grid as frame"
            )
        for name, number in self._frames.items():
            own = np.flatnonzero(frame_of == number)
            for rows in np.array_split(own, 1 + len(own) // _AT_ONCE):
                poses = matrices_of(numbers[rows])
                if target not in ("", name) and len(rows):
                    poses = self.tree.placements(target, name, time_s[rows]) @ poses
                into[rows] = planar(poses)
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
