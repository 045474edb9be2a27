"""Runs of the clock in live topics or recordings; each is one drive.

A stamp that falls back within its topic begins another session: the world was restarted, or a bag
is played once more. Topics may run ahead of each other by any time, so each has its own session.
"""

from array import array
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from serd_app.drives.drive import (
    END,
    EPISODE,
    INTENT,
    LONGEST_GAP_S,
    NO_PAUSES,
    NOT_FINITE,
    POSE,
    EpisodeMark,
    RecordedDrive,
    actions_of_directions,
    finite_poses,
    marks_of,
    source_of,
    spans_of_marks,
    without_pauses,
)
from serd_bag.errors import BagError
from serd_bag.messages.plain import decode, message_stamp_ns, pose_position
from serd_bag.messages.times import RESTART_NS, TimesOnClock, agrees, placed_s
from serd_bag.reader import BagReader
from serd_bag.topic import RawMessage, topic_named
from serd_core.arrays import FloatArray


class Session:
    """One run of the clock; poses and intents: time (s), x and y of each, one after the other.

    newest_pose_ns, newest_end_ns: the newest stamps of poses and of ends of episodes in it.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self.poses, self.intents = array("d"), array("d")
        self.marks: list[EpisodeMark] = []
        self.newest_pose_ns = self.newest_end_ns = 0

    def drive(self, pauses_s: FloatArray = NO_PAUSES) -> RecordedDrive:
        """Everything so far; BagError where there are poses and none is finite."""
        rows = np.array(self.poses).reshape(-1, 3)
        finite = finite_poses(rows, self._source)
        pose = _unique(finite)
        intent = _unique(np.array(self.intents).reshape(-1, 3))
        clear = np.isfinite(intent).all(axis=1)
        n_unclear = int((~clear).sum())
        spans = spans_of_marks(self.marks, pose[:, 0], LONGEST_GAP_S)
        return RecordedDrive(
            pose_time_s=pose[:, 0],
            position_m=pose[:, 1:],
            intent_time_s=intent[clear, 0],
            intent_action=actions_of_directions(intent[clear, 1:]),
            episodes=without_pauses(spans, pose[:, 0], pauses_s),
            source=self._source,
            n_bad_poses=len(rows) - len(finite),
            dropped={NOT_FINITE: n_unclear} if n_unclear else {},
        )


def _unique(rows: FloatArray) -> FloatArray:
    """Rows by time, one per stamp: a message that was sent again counts once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]


class DriveSessions:
    """Collects robot_pose, intent and episode.

    n_ended: end marks of episodes that came so far. n_late: intents that came after the end mark of
    their episode, so that what was gathered then lacks them.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.sessions = [Session(source)]
        self.n_ended = self.n_late = 0
        self._session_of_poses = self.sessions[0]
        self._session_of = dict.fromkeys((POSE, INTENT, EPISODE), 0)
        self._newest_ns = dict.fromkeys((POSE, INTENT, EPISODE), 0)

    def take(self, topic: str, data: bytes, time_ns: int | None = None) -> None:
        """One message of `robot_pose`, `intent` or `episode`; BagError for one that is damaged.

        time_ns: in place of its stamp.
        """
        if topic == POSE:
            self._take_pose(data, time_ns)
            return
        stamp_ns = message_stamp_ns(data) if time_ns is None else time_ns
        session = self._session(topic, stamp_ns)
        if topic == INTENT:
            vector = decode(data, "geometry_msgs/msg/Vector3Stamped").vector
            session.intents.extend((stamp_ns / 1e9, vector.x, vector.y))
            self.n_late += stamp_ns < session.newest_end_ns
            return
        marks = marks_of(data, stamp_ns)
        session.marks += marks
        if any(mark.event == END for mark in marks):
            session.newest_end_ns = max(session.newest_end_ns, stamp_ns)
            self.n_ended += 1

    def _take_pose(self, data: bytes, time_ns: int | None) -> None:
        """Nearly all messages are poses: this decides how fast a bag is read."""
        stamp_ns, x_m, y_m = pose_position(data)
        if time_ns is not None:
            stamp_ns = time_ns
        session = self._session_of_poses
        if stamp_ns < session.newest_pose_ns - RESTART_NS:
            session = self._session_of_poses = self._session(POSE, stamp_ns)
        session.poses.extend((stamp_ns / 1e9, x_m, y_m))
        if stamp_ns > session.newest_pose_ns:
            session.newest_pose_ns = self._newest_ns[POSE] = stamp_ns

    @property
    def caught_up(self) -> bool:
        """Whether the robot's poses have come as far as the newest end of an episode."""
        newest = self.sessions[self._session_of[EPISODE]]
        return newest.newest_pose_ns >= newest.newest_end_ns

    def _session(self, topic: str, stamp_ns: int) -> Session:
        """That of the topic, or the next one where its clock has fallen back."""
        if stamp_ns < self._newest_ns[topic] - RESTART_NS:
            self._session_of[topic] += 1
            self._newest_ns[topic] = 0
            if self._session_of[topic] == len(self.sessions):
                self.sessions.append(Session(self.source))
        elif self._is_of_a_later_session(topic, stamp_ns):
            self._session_of[topic] = len(self.sessions) - 1
        self._newest_ns[topic] = max(self._newest_ns[topic], stamp_ns)
        return self.sessions[self._session_of[topic]]

    def _is_of_a_later_session(self, topic: str, stamp_ns: int) -> bool:
        """Whether a topic that had too few messages to fall back belongs where the poses are."""
        own, newest = self._session_of[topic], len(self.sessions) - 1
        if topic == POSE or own == newest or self._session_of[POSE] != newest:
            return False
        distance_ns = [abs(each.newest_pose_ns - stamp_ns) for each in self.sessions]
        return distance_ns[newest] < distance_ns[own]


def read_drives(directory: str | Path, *, tolerant: bool = False) -> tuple[RecordedDrive, ...]:
    """The drives of a bag; BagError names a topic that is missing or a message that is damaged.

    tolerant: read what a broken bag still holds.
    """
    return drives_in(BagReader(directory, tolerant=tolerant))


def drives_in(reader: BagReader) -> tuple[RecordedDrive, ...]:
    """The drives of an opened bag, whose `damage` then lists what could not be read.

    Where stamps of one of the topics are wrong, the bag is read again by its log times.
    """
    kinds = {topic_named(reader.topics, kind): kind for kind in (POSE, INTENT, EPISODE)}
    #: Log times and stamps (ns) of messages, one after the other.
    times = {kind: array("q") for kind in kinds.values()}

    def noted(kind: str, message: RawMessage) -> int | None:
        """The time in place of a stamp that is not set."""
        try:
            stamp_ns = message_stamp_ns(message.data)
        except BagError:
            stamp_ns = 0  # what takes the message raises
        times[kind].extend((message.log_time_ns, stamp_ns))
        return None if stamp_ns else message.log_time_ns

    n_faults = len(reader.damage)
    found = _sessions_in(reader, kinds, noted)
    in_s = {kind: (np.array(rows).reshape(-1, 2) / 1e9).T for kind, rows in times.items()}
    pauses_s, (log_s, stamp_s) = paused_s(reader), in_s[POSE]
    session = np.zeros(len(pauses_s), dtype=np.int64)
    if _stamps_agree(in_s):
        log_s, stamp_s = log_s[stamp_s > 0], stamp_s[stamp_s > 0]
        session = np.searchsorted(log_s[1:][np.diff(stamp_s) < -RESTART_NS / 1e9], pauses_s)
        pauses_s = TimesOnClock(log_s, stamp_s).of(pauses_s)
    else:
        del reader.damage[n_faults:]  # it is found again
        found = _sessions_in(reader, kinds, lambda _, message: message.log_time_ns)
    return tuple(each.drive(pauses_s[session == row]) for row, each in enumerate(found))


def paused_s(reader: BagReader) -> FloatArray:
    """(P,) log times in the middle of the pauses of the recorder, once all messages were read."""
    pauses_ns = np.array(reader.pauses_ns, dtype=np.float64).reshape(-1, 2)
    return np.asarray(pauses_ns.mean(axis=1) / 1e9)


def _sessions_in(
    reader: BagReader, kinds: Mapping[str, str], time_ns: Callable[[str, RawMessage], int | None]
) -> list[Session]:
    """Those of the topics, each by its kind; time_ns: of a message, None for its stamp."""
    found = DriveSessions(source_of(reader.path))
    for message in reader.messages(kinds):
        kind = kinds[message.topic]
        try:
            found.take(kind, message.data, time_ns(kind, message))
        except BagError as error:
            where = f"{found.source}, {message.topic} at {message.log_time_ns} ns"
            raise BagError(f"{where}: {error}") from None
    return found.sessions


def _stamps_agree(times_s: Mapping[str, FloatArray]) -> bool:
    """Whether the stamps of all topics are of one clock, which need not be that of the log times:
    the bag may be of a simulated world, recorded by the clock of the machine.

    times_s: (2, N) log times and stamps of each topic.
    """
    if agrees(*times_s[POSE]):
        return all(np.array_equal(placed_s(*both_s), both_s[1]) for both_s in times_s.values())
    clock = TimesOnClock(*times_s[POSE])
    return all(agrees(clock.of(log_s), stamp_s) for log_s, stamp_s in times_s.values())
