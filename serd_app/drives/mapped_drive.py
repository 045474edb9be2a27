"""A drive from any bag, by a mapping file: poses in the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp, or with a stamp
of another clock, are put on it by their log time, through the log times and stamps of the poses, at
any rate between the two (`bags/message_times.py`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from bags.errors import BagError
from bags.reader import BagReader
from bags.topic import RawMessage, Topic, topic_named
from serd_app.drives.episode_spans import EpisodeMark, EpisodeSpan, marks_of, spans_of_marks
from serd_app.drives.mapped_actions import MappedActions, PoseTrack
from serd_app.drives.mapped_poses import MappedPoses
from serd_app.drives.mapping import BagMapping
from serd_app.drives.recorded_drive import RecordedDrive, source_of
from serd_app.drives.unmarked import unmarked_spans, usual_gap_s


def mapped_drive_in(
    reader: BagReader, mapping: BagMapping, decision_period_s: float
) -> RecordedDrive:
    """The drive in an opened bag; the reader's `damage` then lists what could not be read."""
    collected = mapped_messages(reader.topics, mapping, source_of(reader.path))
    for message in reader.messages(collected.topics & set(reader.topics)):
        collected.take(message)
    return collected.drive(decision_period_s)


def mapped_messages(
    known: Mapping[str, Topic], mapping: BagMapping, source: str
) -> "MappedMessages":
    """To be filled; BagError where the topics do not hold what the mapping needs."""
    poses = MappedPoses(known, mapping, source)
    own_topic = mapping.has_action_topic
    action = known[topic_named(known, mapping.action_topic)] if own_topic else None
    return MappedMessages(
        mapping,
        source,
        poses,
        MappedActions(mapping, action, source),
        topic_named(known, mapping.episode_topic) if mapping.episode_topic else "",
    )


@dataclass(frozen=True, eq=False)
class MappedMessages:
    """Messages of the topics of a mapping; marks: of episodes, with their log times in s."""

    mapping: BagMapping
    source: str
    poses: MappedPoses
    actions: MappedActions
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
        return {*self.poses.topics, *self.actions.topics, self.mark_topic}

    def take(self, message: RawMessage) -> None:
        """A message of one of them; BagError where it is damaged."""
        self.poses.take(message)
        if message.topic in self.actions.topics:
            self.actions.take(message)
        if message.topic == self.mark_topic:
            log_s = message.log_time_ns / 1e9
            self.marks.extend((log_s, each) for each in marks_of(message.data))

    def drive(self, period_s: float) -> RecordedDrive:
        """The drive, with the intents of decision periods of that length."""
        times_s, poses = self.poses.rows()
        placed = np.isfinite(poses).all(axis=1)
        track = PoseTrack(times_s[placed, 0], times_s[placed, 1], poses[placed])
        longest_gap_s = self.mapping.longest_gap_s or usual_gap_s(times_s[:, 1])
        spans, cuts = self._spans(track, longest_gap_s)
        intents = self.actions.intents(track, spans, period_s)
        return RecordedDrive(
            pose_time_s=track.time_s,
            position_m=track.poses[:, :2],
            intent_time_s=intents.time_s,
            intent_action=intents.action,
            episodes=spans,
            source=self.source,
            n_bad_poses=self.poses.n_bad,
            n_unplaced_poses=int((~placed).sum()),
            n_bad_commands=intents.n_bad_commands,
            dropped=intents.dropped,
            longest_gap_s=longest_gap_s,
            minimum_speed_mps=self.mapping.minimum_speed_mps,
            cuts=cuts,
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
