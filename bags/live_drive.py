"""Decisions from messages as they come: the same as from a bag of them, whatever the pace.

A stamp that falls back within its topic begins another session: the world was restarted, or a bag
is played once more. Topics may run ahead of each other by any time, so each has its own session.
Sessions are joined, and an episode that is there already in every decision counts once.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from bags.demonstrations import Demonstrations
from bags.discretise import DiscretisationReport, decisions_from_drive
from bags.goal_entry import goal_entries_s
from bags.recorded_drive import CUT_OFF, EPISODE, INTENT, POSE, DriveBuilder, is_end_mark
from bags.stamp import message_stamp_ns
from serd_core.grid import Grid

_RESTART_NS = 1_000_000_000


@dataclass(eq=False)
class _Session:
    """One run of the clock; the newest stamps of poses and of ends of episodes in it."""

    builder: DriveBuilder
    newest_pose_ns: int = 0
    newest_end_ns: int = 0


@dataclass(eq=False)
class LiveDrive:
    """Collects robot_pose, intent and episode, raw; `gathered` says what they amount to.

    earlier: what was known before. n_ended: end marks of episodes that came so far. n_late: intents
    that came after the end mark of their episode, so that what was gathered then lacks them.
    """

    source: str
    grid: Grid
    decision_period_s: float
    earlier: Demonstrations | None = None
    report: DiscretisationReport | None = field(default=None, init=False)
    n_ended: int = field(default=0, init=False)
    n_late: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._sessions = [_Session(DriveBuilder(self.source))]
        self._session_of = dict.fromkeys((POSE, INTENT, EPISODE), 0)
        self._newest_ns = dict.fromkeys((POSE, INTENT, EPISODE), 0)

    def take(self, topic: str, data: bytes) -> None:
        """One message of `robot_pose`, `intent` or `episode`; BagError for one that is damaged.

        There must be stamps: live there is no log time to fall back on, and worlds begin at 0.
        """
        stamp_ns = message_stamp_ns(data)
        session = self._session(topic, stamp_ns)
        if topic == POSE:
            session.builder.add_pose(data, stamp_ns)
            session.newest_pose_ns = max(session.newest_pose_ns, stamp_ns)
        elif topic == INTENT:
            session.builder.add_intent(data, stamp_ns)
            self.n_late += stamp_ns < session.newest_end_ns
        else:
            session.builder.add_mark(data, stamp_ns)
            if is_end_mark(data):
                session.newest_end_ns = max(session.newest_end_ns, stamp_ns)
                self.n_ended += 1

    @property
    def caught_up(self) -> bool:
        """Whether the robot's poses have come as far as the newest end of an episode."""
        newest = self._sessions[self._session_of[EPISODE]]
        return newest.newest_pose_ns >= newest.newest_end_ns

    def gathered(self, *, unfinished: bool = True) -> Demonstrations:
        """All episodes so far; `report` then tells of those of the last session.

        unfinished: also what there is of the episode that is still being driven.
        """
        found = self.earlier
        for session in self._sessions:
            last = session is self._sessions[-1]
            found = self._with(found, session, unfinished=unfinished or not last)
        assert found is not None
        return found

    def _session(self, topic: str, stamp_ns: int) -> _Session:
        """That of the topic, or the next one where its clock has fallen back."""
        if stamp_ns < self._newest_ns[topic] - _RESTART_NS:
            self._session_of[topic] += 1
            self._newest_ns[topic] = 0
            if self._session_of[topic] == len(self._sessions):
                self._sessions.append(_Session(DriveBuilder(self.source)))
        elif self._is_of_a_later_session(topic, stamp_ns):
            self._session_of[topic] = len(self._sessions) - 1
        self._newest_ns[topic] = max(self._newest_ns[topic], stamp_ns)
        return self._sessions[self._session_of[topic]]

    def _is_of_a_later_session(self, topic: str, stamp_ns: int) -> bool:
        """Whether a topic that had too few messages to fall back belongs where the poses are."""
        own, newest = self._session_of[topic], len(self._sessions) - 1
        if topic == POSE or own == newest or self._session_of[POSE] != newest:
            return False
        distance_ns = [abs(each.newest_pose_ns - stamp_ns) for each in self._sessions]
        return distance_ns[newest] < distance_ns[own]

    def _with(
        self, known: Demonstrations | None, session: _Session, *, unfinished: bool
    ) -> Demonstrations:
        drive = session.builder.drive()
        if not unfinished and drive.episodes and drive.episodes[-1].outcome == CUT_OFF:
            drive = replace(drive, episodes=drive.episodes[:-1])
        decisions, self.report = decisions_from_drive(drive, self.grid, self.decision_period_s)
        rows = Demonstrations(decisions).episode_rows
        seen = set(known.episode_rows.values()) if known is not None else set()
        fresh = [episode for episode, row in rows.items() if row not in seen]
        decisions = decisions.select(np.isin(decisions.episode, fresh))
        entry_s = goal_entries_s(drive.episodes, decisions, self.decision_period_s)
        here = Demonstrations(decisions, tuple(entry_s.tolist()))
        return here if known is None else known.joined(here)
