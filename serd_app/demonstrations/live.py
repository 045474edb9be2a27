"""Decisions from topics as they come: those that a bag of them gives."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_app.demonstrations.discretise import (
    DiscretisationReport,
    decisions_from_drive,
    episode_rows,
)
from serd_app.drives.drive import CUT_OFF, RecordedDrive
from serd_app.drives.mapped import MappedMessages, mapped_messages
from serd_app.drives.mapping import UNMARKED, BagMapping
from serd_app.drives.sessions import DriveSessions
from serd_bag.errors import BagError
from serd_bag.topic import RawMessage, Topic
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Grid

_SOURCE = "live topics"


class GatheredDecisions:
    """The decisions of drives on a grid, after those that are known.

    patience_s, wait_s: see `DecisionEpochs`. report: what was left out of the last drive.
    """

    def __init__(
        self, grid: Grid, patience_s: float, wait_s: float, earlier: TimedDecisions | None
    ) -> None:
        self._grid, self._times_s, self._earlier = grid, (patience_s, wait_s), earlier
        self.report: DiscretisationReport | None = None

    def of_drives(self, drives: Sequence[RecordedDrive]) -> TimedDecisions:
        """All decisions, those of an episode that was there before once."""
        known = [] if self._earlier is None else [self._earlier]
        seen = {row for one in known for row in episode_rows(one).values()}
        for drive in drives:
            decisions, self.report = decisions_from_drive(drive, self._grid, *self._times_s, seen)
            known.append(decisions)
        return concatenate_renumbered(known)


class LiveDrive(DriveSessions, GatheredDecisions):
    """Collects robot_pose, intent and episode as they come; gives the decisions of a bag of them.

    earlier: demonstrations known before.
    """

    def __init__(
        self,
        source: str,
        grid: Grid,
        patience_s: float,
        wait_s: float,
        earlier: TimedDecisions | None = None,
    ) -> None:
        DriveSessions.__init__(self, source)
        GatheredDecisions.__init__(self, grid, patience_s, wait_s, earlier)

    def gathered(self, *, unfinished: bool = True) -> TimedDecisions:
        """All episodes so far; unfinished: also decisions of the episode still being driven."""
        *before, last = (session.drive() for session in self.sessions)
        if not unfinished and last.episodes and last.episodes[-1].outcome == CUT_OFF:
            last = replace(last, episodes=last.episodes[:-1])
        return self.of_drives([*before, last])


class MappedLiveDrive(GatheredDecisions):
    """Collects the topics of a mapping as they come; gives the decisions of a bag of them.

    n_ended: episodes that had ended at the last `look`. n_late, caught_up: as of `LiveDrive`; what
    was gathered is gathered anew each time.
    """

    def __init__(
        self,
        mapping: BagMapping,
        grid: Grid,
        patience_s: float,
        wait_s: float,
        earlier: TimedDecisions | None = None,
    ) -> None:
        super().__init__(grid, patience_s, wait_s, earlier)
        self.mapping, self.n_ended, self.n_late, self.caught_up = mapping, 0, 0, True
        self._messages: MappedMessages | None = None
        self.n_messages = 0

    @property
    def wanted(self) -> tuple[str, ...]:
        """Names of the topics that must be known to begin, as the mapping has them."""
        mapping = self.mapping
        actions = (mapping.action_topic,) if mapping.has_action_topic else ()
        return tuple(filter(None, (mapping.pose_topic, *actions, mapping.episode_topic)))

    def begin(self, known: Mapping[str, Topic]) -> set[str]:
        """Collect from topics, of which the mapping's are returned; BagError where they do not
        hold what it needs."""
        self._messages = mapped_messages(known, self.mapping, _SOURCE)
        return self._messages.topics

    def take(self, message: RawMessage) -> None:
        """One message of them; BagError where it is damaged."""
        assert self._messages is not None
        self._messages.take(message)
        self.n_messages += 1

    def look(self) -> None:
        """Count the episodes that have ended; more poses may yet divide them otherwise."""
        self.n_ended = len(self._drive(unfinished=False).episodes)

    def gathered(self, *, unfinished: bool = True) -> TimedDecisions:
        """All episodes so far; unfinished: also decisions of the episode still being driven."""
        return self.of_drives([self._drive(unfinished=unfinished)])

    def _drive(self, *, unfinished: bool) -> RecordedDrive:
        if self._messages is None:
            raise BagError(
                f"topics {', '.join(self.wanted)} of the mapping must have publishers, they have"
                " none; start them, or correct the mapping"
            )
        drive = self._messages.drive()
        runs_on = drive.episodes and drive.episodes[-1].outcome in (UNMARKED, CUT_OFF)
        if unfinished or not runs_on or drive.episodes[-1].end_s < drive.pose_time_s[-1]:
            return drive
        return replace(drive, episodes=drive.episodes[:-1])
