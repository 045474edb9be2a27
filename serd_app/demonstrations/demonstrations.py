"""What is learned from: the decisions of demonstrations, of a bag or as they come."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from serd_app.demonstrations.decision_table import concatenate_renumbered
from serd_app.demonstrations.discretise import (
    DiscretisationReport,
    DividedEpisodes,
    decisions_from_drive,
    episode_rows,
    joined_reports,
)
from serd_app.drives.episode_spans import CUT_OFF
from serd_app.drives.mapped.actions import with_hidden_actions
from serd_app.drives.recorded_drive import RecordedDrive
from serd_app.drives.sessions import DriveSessions, read_drives
from serd_bag.errors import BagError
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.grid.grid import Grid


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """Decisions, by the numbers of their episodes."""

    decisions: TimedDecisions

    @cached_property
    def episode_rows(self) -> dict[int, bytes]:
        """See `discretise.episode_rows`."""
        return episode_rows(self.decisions)


def joined(parts: Sequence[Demonstrations]) -> Demonstrations:
    """All of them; later episodes are numbered on."""
    first, *others = parts
    for later in others:
        first = Demonstrations(concatenate_renumbered([first.decisions, later.decisions]))
    return first


def demonstrations_of_bag(
    bag: str | Path, grid: Grid, patience_s: float, wait_s: float, *, hidden: bool = False
) -> tuple[Demonstrations, DiscretisationReport]:
    """Those of a bag, and what was left out; BagError where there is nothing to use.

    patience_s, wait_s: see `DecisionEpochs`. hidden: without intents, from poses and episodes
    alone.
    """
    drives: Sequence[RecordedDrive] = read_drives(bag, intents=not hidden)
    if hidden:
        drives = [with_hidden_actions(drive) for drive in drives]
    found, report = demonstrations_of_drives(drives, grid, patience_s, wait_s)
    if not len(found.decisions):
        raise BagError(f"bag {bag} holds no decision to learn from: {report}; record more")
    return found, report


def demonstrations_of_drives(
    drives: Sequence[RecordedDrive],
    grid: Grid,
    patience_s: float,
    wait_s: float,
    *,
    seen: set[bytes] | None = None,
    agents: bool = False,
) -> tuple[Demonstrations, DiscretisationReport]:
    """Those of all drives of one recording, at least one, and what was left out.

    seen: `episode_rows` of earlier episodes, to which those of the drives are added; an episode
    that was seen in every decision counts once. agents: the drives are of different agents, of whom
    two may decide the same at the same times, so that those of the same places alone are repeated.
    """
    seen = set() if seen is None else seen
    known = frozenset(seen)
    parts, reports = [], []
    for drive in drives:
        track = drive.pose_time_s.tobytes() + drive.position_m.tobytes()
        seen_here = set(known if track in known else ()) if agents else seen
        decisions, report = decisions_from_drive(drive, grid, patience_s, wait_s, seen_here)
        seen |= seen_here | ({track} if agents else set())
        parts.append(Demonstrations(decisions))
        reports.append(report)
    return joined(parts), joined_reports(reports)


class LiveDrive(DriveSessions):
    """Collects robot_pose, intent and episode as they come; gives the decisions of a bag of them.

    An episode is divided into decisions again only where something of it has come since.

    earlier: demonstrations known before. report: what was left out of the last session.
    hidden: whether poses and episodes alone are used.
    """

    def __init__(
        self,
        source: str,
        grid: Grid,
        patience_s: float,
        wait_s: float,
        earlier: Demonstrations | None = None,
        *,
        hidden: bool = False,
    ) -> None:
        super().__init__(source)
        self._grid, self._times_s, self._earlier = grid, (patience_s, wait_s), earlier
        self._hidden = hidden
        self._divided: DividedEpisodes = {}
        self.report: DiscretisationReport | None = None

    def gathered(self, *, unfinished: bool = True) -> Demonstrations:
        """All episodes so far; unfinished: also decisions of the episode still being driven."""
        *before, last = (session.drive() for session in self.sessions)
        if not unfinished and last.episodes and last.episodes[-1].outcome == CUT_OFF:
            last = replace(last, episodes=last.episodes[:-1])
        known = [] if self._earlier is None else [self._earlier]
        seen = {row for one in known for row in one.episode_rows.values()}
        for recorded in (*before, last):
            drive = with_hidden_actions(recorded) if self._hidden else recorded
            decisions, self.report = decisions_from_drive(
                drive, self._grid, *self._times_s, seen, self._divided
            )
            known.append(Demonstrations(decisions))
        return joined(known)
