"""Decisions from messages as they come: the same as from a bag of them, whatever the pace.

A stamp that falls back begins another session: the world was restarted, or a bag is played once
more. Sessions are joined, and an episode that is there already in every decision counts once.
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
class LiveDrive:
    """Collects robot_pose, intent and episode, raw; `gathered` says what they amount to.

    earlier: what was known before. n_ended: end marks of episodes that came so far.
    """

    source: str
    grid: Grid
    decision_period_s: float
    earlier: Demonstrations | None = None
    report: DiscretisationReport | None = field(default=None, init=False)
    n_ended: int = field(default=0, init=False)
    _newest_ns: int = field(default=0, init=False)
    _newest_pose_ns: int = field(default=0, init=False)
    _newest_end_ns: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._builder = DriveBuilder(self.source)

    def take(self, topic: str, data: bytes) -> None:
        """One message of `robot_pose`, `intent` or `episode`; BagError for one that is damaged."""
        # Without a stamp it counts as made at the newest one, as the recorder has it.
        stamp_ns = message_stamp_ns(data) or self._newest_ns
        if stamp_ns < self._newest_ns - _RESTART_NS:
            self.earlier = self.gathered()
            self._builder = DriveBuilder(self.source)
            self._newest_ns = self._newest_pose_ns = self._newest_end_ns = 0
        self._newest_ns = max(self._newest_ns, stamp_ns)
        take = {
            POSE: self._builder.add_pose,
            INTENT: self._builder.add_intent,
            EPISODE: self._builder.add_mark,
        }[topic]
        take(data, stamp_ns)
        if topic == POSE:
            self._newest_pose_ns = max(self._newest_pose_ns, stamp_ns)
        elif topic == EPISODE and is_end_mark(data):
            self._newest_end_ns = max(self._newest_end_ns, stamp_ns)
            self.n_ended += 1

    @property
    def caught_up(self) -> bool:
        """Whether the robot's poses have come as far as the newest end of an episode."""
        return self._newest_pose_ns >= self._newest_end_ns

    def gathered(self, *, unfinished: bool = True) -> Demonstrations:
        """All episodes so far; `report` then tells of those of the present session.

        unfinished: also what there is of the episode that is still being driven.
        """
        drive = self._builder.drive()
        if not unfinished and drive.episodes and drive.episodes[-1].outcome == CUT_OFF:
            drive = replace(drive, episodes=drive.episodes[:-1])
        decisions, self.report = decisions_from_drive(drive, self.grid, self.decision_period_s)
        known = set(self.earlier.episode_rows.values()) if self.earlier is not None else set()
        rows = Demonstrations(decisions).episode_rows
        fresh = [episode for episode, row in rows.items() if row not in known]
        decisions = decisions.select(np.isin(decisions.episode, fresh))
        entry_s = goal_entries_s(drive.episodes, decisions, self.decision_period_s)
        here = Demonstrations(decisions, tuple(entry_s.tolist()))
        return here if self.earlier is None else self.earlier.joined(here)
