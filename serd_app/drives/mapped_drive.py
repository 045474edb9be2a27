"""A drive from any bag, by a mapping file: poses in the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp, or with a stamp
of another clock, are put on it by their log time, through the log times and stamps of the poses, at
any rate between the two (`bags/message_times.py`).
"""

from collections.abc import Mapping
from dataclasses import replace

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
    return _Collector(reader, mapping).drive(decision_period_s)


class _Collector:
    """Rows of numbers per topic, collected in one pass over the bag."""

    def __init__(self, reader: BagReader, mapping: BagMapping) -> None:
        known = reader.topics
        self._mapping = mapping
        self._source = source_of(reader.path)
        self._poses = MappedPoses(known, mapping, self._source)
        self._actions = MappedActions(mapping, self._action_topic(known), self._source)
        self._require_heading()
        marks = mapping.episode_topic
        self._mark_topic = topic_named(known, marks) if marks else ""
        self._marks: list[tuple[float, EpisodeMark]] = []  # with log times
        wanted = {*self._poses.topics, *self._actions.topics, self._mark_topic}
        for message in reader.messages(wanted & set(known)):
            self._take(message)

    def drive(self, period_s: float) -> RecordedDrive:
        """The drive, with the intents of decision periods of that length."""
        times_s, poses = self._poses.rows()
        placed = np.isfinite(poses).all(axis=1)
        track = PoseTrack(times_s[placed, 0], times_s[placed, 1], poses[placed])
        longest_gap_s = self._mapping.longest_gap_s or usual_gap_s(times_s[:, 1])
        spans, cuts = self._spans(track, longest_gap_s)
        intents = self._actions.intents(track, spans, period_s)
        return RecordedDrive(
            pose_time_s=track.time_s,
            position_m=track.poses[:, :2],
            intent_time_s=intents.time_s,
            intent_action=intents.action,
            episodes=spans,
            source=self._source,
            n_bad_poses=self._poses.n_bad,
            n_unplaced_poses=int((~placed).sum()),
            n_bad_commands=intents.n_bad_commands,
            dropped=intents.dropped,
            longest_gap_s=longest_gap_s,
            minimum_speed_mps=self._mapping.minimum_speed_mps,
            cuts=cuts,
        )

    def _action_topic(self, known: Mapping[str, Topic]) -> Topic | None:
        if self._mapping.action_from == "motion":
            return None
        return known[topic_named(known, self._mapping.action_topic)]

    def _require_heading(self) -> None:
        if self._mapping.action_from == "velocity" and not self._poses.has_heading:
            raise BagError(
                f"{self._source}: pose_topic {self._mapping.pose_topic} must have a heading, by"
                " which velocities are turned, it has x and y alone; name a third path in"
                " pose_fields, or set action_from: motion"
            )

    def _take(self, message: RawMessage) -> None:
        self._poses.take(message)
        if message.topic in self._actions.topics:
            self._actions.take(message)
        if message.topic == self._mark_topic:
            log_s = message.log_time_ns / 1e9
            self._marks += [(log_s, each) for each in marks_of(message.data)]

    def _spans(
        self, track: PoseTrack, longest_gap_s: float
    ) -> tuple[tuple[EpisodeSpan, ...], Mapping[str, int]]:
        """Episodes, and what those without marks were cut at."""
        if not self._mark_topic:
            return unmarked_spans(track.time_s, track.poses[:, :2], longest_gap_s, self._mapping)
        rows = np.array([(log_s, mark.time_s) for log_s, mark in self._marks]).reshape(-1, 2)
        placed = zip(track.placed(*rows.T), self._marks, strict=True)
        marks = (replace(mark, time_s=float(at_s)) for at_s, (_, mark) in placed)
        return spans_of_marks(marks, track.time_s, longest_gap_s), {}
