"""A drive from any bag, by a mapping file: poses in the grid's frame, actions inferred.

The clock is that of the pose stamps (wall or simulated). Messages without a stamp, or with a stamp
of another clock, are put on it by their log time, through the log times and stamps of the poses, at
any rate between the two (`bags/serd_bag/messages/times.py`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from serd_app.drives.episode_spans import EpisodeMark, EpisodeSpan, marks_of, spans_of_marks
from serd_app.drives.mapped.actions import MappedActions, PoseTrack
from serd_app.drives.mapped.mapping import BagMapping
from serd_app.drives.mapped.poses import MappedPoses
from serd_app.drives.recorded_drive import RecordedDrive, source_of
from serd_app.drives.unmarked import unmarked_spans, usual_gap_s
from serd_bag.errors import BagError
from serd_bag.messages.fields import FieldReader, field_reader, store_of
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, Topic, topic_named
from serd_core.arrays import FloatArray


def mapped_drive_in(reader: BagReader, mapping: BagMapping) -> RecordedDrive:
    """The drive in an opened bag; the reader's `damage` then lists what could not be read."""
    collected = mapped_messages(reader.topics, mapping, source_of(reader.path))
    for message in reader.messages(collected.topics & set(reader.topics)):
        collected.take(message)
    return collected.drive()


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
        _button(known, mapping) if mapping.button_topic else None,
    )


def _button(known: Mapping[str, Topic], mapping: BagMapping) -> tuple[str, FieldReader]:
    """The topic of the button, and the reader of its state, of no number where there is none."""
    topic = known[topic_named(known, mapping.button_topic)]
    if not mapping.button_field:
        return topic.name, FieldReader(topic.type_name, store_of(topic), ())
    paths, wanted = (mapping.button_field,), "a number or truth value"
    return topic.name, field_reader(topic, paths, (), "button_field", wanted)


@dataclass(frozen=True, eq=False)
class MappedMessages:
    """Messages of the topics of a mapping; marks: of episodes, with their log times in s.

    button: its topic and the reader of its state; states: log time, stamp and state of each
    message.
    """

    mapping: BagMapping
    source: str
    poses: MappedPoses
    actions: MappedActions
    mark_topic: str = ""
    button: tuple[str, FieldReader] | None = None
    marks: list[tuple[float, EpisodeMark]] = field(default_factory=list)
    states: list[tuple[float, float, float]] = field(default_factory=list)

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
        button = {self.button[0]} if self.button else set()
        return {*self.poses.topics, *self.actions.topics, self.mark_topic} | button

    def take(self, message: RawMessage) -> None:
        """A message of one of them; BagError where it is damaged."""
        self.poses.take(message)
        if message.topic in self.actions.topics:
            self.actions.take(message)
        if message.topic == self.mark_topic:
            log_s = message.log_time_ns / 1e9
            self.marks.extend((log_s, each) for each in marks_of(message.data))
        if self.button is not None and message.topic == self.button[0]:
            header, state = self.button[1](message.data)
            pressed = state[0] if state else 1.0
            self.states.append((message.log_time_ns / 1e9, header.stamp_ns / 1e9, pressed))

    def drive(self) -> RecordedDrive:
        """The drive of all messages so far."""
        times_s, poses = self.poses.rows()
        placed = np.isfinite(poses).all(axis=1)
        track = PoseTrack(times_s[placed, 0], times_s[placed, 1], poses[placed])
        longest_gap_s = self.mapping.longest_gap_s or usual_gap_s(times_s[:, 1])
        spans, cuts = self._spans(track, longest_gap_s)
        intents = self.actions.intents(track, spans)
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
            intent_hold_s=intents.hold_s,
            longest_gap_s=longest_gap_s,
            minimum_speed_mps=self.mapping.minimum_speed_mps,
            cuts=cuts,
        )

    def _spans(
        self, track: PoseTrack, longest_gap_s: float
    ) -> tuple[tuple[EpisodeSpan, ...], Mapping[str, int]]:
        """Episodes, and what those without marks were cut at."""
        if not self.mark_topic:
            places_m, pressed_s = track.poses[:, :2], self._presses(track)
            return unmarked_spans(track.time_s, places_m, longest_gap_s, self.mapping, pressed_s)
        rows = np.array([(log_s, mark.time_s) for log_s, mark in self.marks]).reshape(-1, 2)
        placed = zip(track.placed(*rows.T), self.marks, strict=True)
        marks = (replace(mark, time_s=float(at_s)) for at_s, (_, mark) in placed)
        return spans_of_marks(marks, track.time_s, longest_gap_s), {}

    def _presses(self, track: PoseTrack) -> FloatArray | None:
        """(N,) times of the messages at which the button goes down; None without a button."""
        if self.button is None:
            return None
        rows = np.array(self.states).reshape(-1, 3)
        at_s, down = track.placed(rows[:, 0], rows[:, 1]), rows[:, 2] > 0.5
        if self.mapping.button_field:
            down &= ~np.append(False, down[:-1])[: len(down)]
        return np.unique(at_s[down])
